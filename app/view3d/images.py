"""The scene as images of any size, and as movies: a turntable, or a recording."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image
from PySide6.QtWidgets import QProgressDialog

from app.view3d.scene import Scene
from app.view3d.style import Ink
from app.view3d.surface import Surface
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically

Rgb = NDArray[np.uint8]
LETTERS, LEAST_PT = 40, 16
"""Lines of letters that would fill a printed image, and the smallest letters."""


class Studio:
    """A copy of a scene that is rendered off screen, in its own size.

    Parameters
    ----------
    scene : Scene
        The original, with its viewpoint.
    size : (width, height)
        In pixels.
    paper : bool, optional
        For a printed page: white background, large letters.
    """

    def __init__(self, scene: Scene, size: tuple[int, int], *, paper: bool = False) -> None:
        self._plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        self.scene = Scene(self._plotter)
        scene.copy_to(self.scene, Ink(font=max(min(size) // LETTERS, LEAST_PT)) if paper else None)
        # A saved image has no measuring tools, so it gets a scale bar.
        self.scene.set_style(replace(scene.style, scale_bar=True))
        self.scene.viewpoint = scene.viewpoint

    def draw(self, *, transparent: bool = False) -> Rgb:
        """Return the image, (height, width, 3), or 4 channels with a transparent background."""
        if transparent:
            self._plotter.renderer.GradientBackgroundOff()  # a gradient would stay opaque
        self._plotter.render()
        return np.asarray(
            self._plotter.screenshot(None, transparent_background=transparent, return_img=True)
        )

    def turn(self, degrees: float) -> None:
        """Rotate the camera about the surface's vertical axis."""
        turn = pv.Transform().rotate_z(degrees, point=self._plotter.camera.focal_point)
        self._plotter.camera.ApplyTransform(turn)
        self._plotter.renderer.ResetCameraClippingRange()

    def close(self) -> None:
        """Release the graphics memory."""
        self._plotter.close()


@contextmanager
def studio(scene: Scene, size: tuple[int, int], *, paper: bool = False) -> Iterator[Studio]:
    """Open a studio and close it at the end."""
    opened = Studio(scene, size, paper=paper)
    try:
        yield opened
    finally:
        opened.close()


def image_of(
    scene: Scene, size: tuple[int, int], *, transparent: bool = False, paper: bool = False
) -> Rgb:
    """Return the scene as an image of any size, with axes, colour bar and scale bar."""
    with studio(scene, size, paper=paper) as opened:
        return opened.draw(transparent=transparent)


class MovieCancelled(Exception):
    """The user does not want the movie any more."""


def turntable(studio: Studio, count: int) -> Iterator[Rgb]:
    """Yield the images of one whole turn."""
    for _ in range(count):
        yield studio.draw()
        studio.turn(360.0 / count)


def playback(studio: Studio, surfaces: Iterable[Surface]) -> Iterator[Rgb]:
    """Yield an image of each surface."""
    for surface in surfaces:
        studio.scene.show_surface(surface)
        yield studio.draw()


def watched(images: Iterable[Rgb], progress: QProgressDialog) -> Iterator[Rgb]:
    """Yield images, and show how many there were, until the user cancels."""
    for number, rgb in enumerate(images, 1):
        progress.setValue(number)  # also handles the events of the window
        if progress.wasCanceled():
            raise MovieCancelled
        yield rgb


def write_movie(path: Path, rate_hz: float, images: Iterable[Rgb]) -> int:
    """Write images to an MP4 (MPEG-4 part 2) or GIF file, completely or not at all.

    Parameters
    ----------
    path : Path
        Ends with ``.mp4`` or ``.gif``.
    rate_hz : float
        Frames per second.
    images : iterable of (height, width, 3) uint8
        All of the same size.

    Returns
    -------
    count : int
        Number of frames.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    if path.suffix.lower() == ".gif":
        return _write_gif(path, rate_hz, images)
    # A name that nobody can have given to a link before.
    partial = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    video, count = cv2.VideoWriter(), 0
    try:
        for rgb in images:
            # The codec only accepts even sizes.
            rgb = rgb[: rgb.shape[0] // 2 * 2, : rgb.shape[1] // 2 * 2]
            if not count:
                code, size = cv2.VideoWriter.fourcc(*"mp4v"), (rgb.shape[1], rgb.shape[0])
                video.open(str(partial), code, rate_hz, size)
            video.write(cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2BGR))
            count += 1
        video.release()
        if not partial.is_file() or partial.stat().st_size == 0:
            raise _refusal(path)
        partial.replace(path)
    finally:
        video.release()
        partial.unlink(missing_ok=True)
    return count


def _write_gif(path: Path, rate_hz: float, images: Iterable[Rgb]) -> int:
    frames = [Image.fromarray(rgb).convert("P", palette=Image.Palette.ADAPTIVE) for rgb in images]
    if not frames:
        raise _refusal(path)
    step_ms = max(round(1e3 / rate_hz), 20)  # programs show shorter steps at another rate
    write_atomically(
        path,
        lambda file: frames[0].save(
            file, "GIF", save_all=True, append_images=frames[1:], duration=step_ms, loop=0
        ),
    )
    return len(frames)


def _refusal(path: Path) -> InputError:
    return InputError(
        "The movie cannot be written", path, "Choose another folder, or GIF instead of MP4"
    )
