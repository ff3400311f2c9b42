"""The scene as image files: PNG in any size, and movies of a turntable or a recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

from app.view3d.scene import Scene
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.translation import tr

Rgb = NDArray[np.uint8]


class Studio:
    """A copy of a scene that is rendered off screen, in its own size.

    Parameters
    ----------
    scene : Scene
        The original, with its viewpoint.
    size : (width, height)
        In pixels.
    """

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self._plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        self.scene = Scene(self._plotter)
        scene.copy_to(self.scene)
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
def studio(scene: Scene, size: tuple[int, int]) -> Iterator[Studio]:
    """Open a studio and close it at the end."""
    opened = Studio(scene, size)
    try:
        yield opened
    finally:
        opened.close()


def image_of(scene: Scene, size: tuple[int, int], *, transparent: bool = False) -> Rgb:
    """Return the scene as an image of any size, with axes, colour bar and scale bar."""
    with studio(scene, size) as opened:
        return opened.draw(transparent=transparent)


class MovieWriter:
    """Writes frames to an MP4 (MPEG-4 part 2) or GIF file, completely or not at all.

    Parameters
    ----------
    path : Path
        Ends with ``.mp4`` or ``.gif``.
    rate_hz : float
        Frames per second.

    Raises
    ------
    InputError
        If the file cannot be written.
    """

    def __init__(self, path: Path, rate_hz: float) -> None:
        self._path, self._rate_hz = path, rate_hz
        self._partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        self._video: cv2.VideoWriter | None = None
        self._frames: list[Image.Image] = []

    def add(self, rgb: Rgb) -> None:
        """Add a frame, (height, width, 3) uint8. All frames have the same size."""
        if self._path.suffix.lower() == ".gif":
            colours = Image.Palette.ADAPTIVE
            self._frames.append(Image.fromarray(rgb).convert("P", palette=colours))
            return
        # The codec only accepts even sizes.
        rgb = rgb[: rgb.shape[0] // 2 * 2, : rgb.shape[1] // 2 * 2]
        if self._video is None:
            code = cv2.VideoWriter.fourcc(*"mp4v")
            size = rgb.shape[1], rgb.shape[0]
            self._video = cv2.VideoWriter(str(self._partial), code, self._rate_hz, size)
            if not self._video.isOpened():
                raise self._refusal()
        self._video.write(cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2BGR))

    def finish(self) -> None:
        """Move the finished file to its path."""
        if self._frames:
            first, *others = self._frames
            step_ms = max(round(1e3 / self._rate_hz), 20)
            write_atomically(
                self._path,
                lambda file: first.save(
                    file, "GIF", save_all=True, append_images=others, duration=step_ms, loop=0
                ),
            )
            return
        if self._video is None:
            raise self._refusal()
        self._video.release()
        if not self._partial.is_file() or self._partial.stat().st_size == 0:
            raise self._refusal()
        self._partial.replace(self._path)

    def cancel(self) -> None:
        """Delete the temporary file."""
        if self._video is not None:
            self._video.release()
        self._partial.unlink(missing_ok=True)
        self._frames.clear()

    def _refusal(self) -> InputError:
        self.cancel()
        return InputError(
            tr("The movie cannot be written"),
            where=str(self._path),
            advice=tr("Choose another folder, or GIF instead of MP4"),
        )
