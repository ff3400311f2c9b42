"""The scene as images of any size."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
import pyvista as pv

from gelpolight_core.base.arrays import Rgb8Array

from .scene import Scene
from .style import SceneColours

LETTERS, LEAST_PT = 40, 16
"""Lines of letters that would fill a printed image, and the smallest letters."""


class OffscreenScene:
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
        scene.copy_to(
            self.scene, SceneColours(font=max(min(size) // LETTERS, LEAST_PT)) if paper else None
        )
        # A saved image has no measuring tools, so it gets a scale bar.
        self.scene.set_style(replace(scene.style, scale_bar=True))

    def draw(self, *, transparent: bool = False) -> Rgb8Array:
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


def image_of(
    scene: Scene, size: tuple[int, int], *, transparent: bool = False, paper: bool = False
) -> Rgb8Array:
    """Return the scene as an image of any size, with axes, colour bar and scale bar."""
    with closing(OffscreenScene(scene, size, paper=paper)) as studio:
        return studio.draw(transparent=transparent)
