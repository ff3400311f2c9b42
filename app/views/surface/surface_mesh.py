"""The surface as a pyvista mesh with a texture, both updated in place from frame to frame."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from pyvista.plotting import BasePlotter

from .display_surface import DisplaySurface


class SurfaceMesh:
    """Triangle strips between the rows of a surface."""

    def __init__(self) -> None:
        self.mesh = pv.PolyData()
        self._x = np.zeros((0, 0), np.float32)

    def show(self, surface: DisplaySurface) -> None:
        """Copy a surface's depth."""
        if not np.array_equal(surface.x_mm, self._x):
            self._x = surface.x_mm
            self.mesh.copy_from(_strips(surface))
        self.mesh.points[:, 2] = surface.depth_mm.ravel()
        self.mesh.GetPoints().Modified()


def _strips(surface: DisplaySurface) -> pv.PolyData:
    rows, columns = surface.depth_mm.shape
    left, top, right, bottom = surface.extent_mm
    x, y = surface.x_mm, np.broadcast_to(surface.y_mm[:, None], surface.x_mm.shape)
    points = np.stack([x, -y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    upper = np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    nodes = np.stack([upper, upper + columns], axis=-1).reshape(rows - 1, 2 * columns)
    mesh = pv.PolyData(points, strips=np.insert(nodes, 0, 2 * columns, axis=1).ravel())
    share = np.stack([(x - left) / (right - left), (y - top) / (bottom - top)], axis=-1)
    mesh.active_texture_coordinates = share.reshape(-1, 2).astype(np.float32)
    return mesh


class SurfaceActor:
    """The surface on a plotter, with its shaded texture. Coarse during camera moves."""

    def __init__(self, plotter: BasePlotter) -> None:
        self._fine, self._coarse = SurfaceMesh(), SurfaceMesh()
        self._texture = pv.Texture(np.zeros((1, 1, 3), np.uint8))
        self._image = pv.ImageData(dimensions=(1, 1, 1))
        how = {"show_scalar_bar": False, "reset_camera": False, "render": False, "lighting": False}
        self.actor = plotter.add_mesh(
            pv.Plane(), texture=self._texture, color="white", name="surface", **how
        )
        self.actor.visibility = False

    def show(self, surface: DisplaySurface) -> None:
        """Show a surface with all its nodes."""
        self._fine.show(surface)
        self._show_texture(surface.texture)
        self.refine()
        self.actor.visibility = True

    def coarsen(self, surface: DisplaySurface, largest: int) -> None:
        """Draw at most this many nodes per side until :meth:`refine`."""
        if max(surface.depth_mm.shape) > largest:
            self._coarse.show(surface.thinned(largest))
            self.actor.mapper.SetInputData(self._coarse.mesh)

    def refine(self) -> None:
        """Draw all nodes."""
        self.actor.mapper.SetInputData(self._fine.mesh)

    def _show_texture(self, rgb: NDArray[np.uint8]) -> None:
        rows, columns = rgb.shape[:2]
        if self._image.dimensions != (columns, rows, 1):
            image = pv.ImageData(dimensions=(columns, rows, 1))
            image.point_data["rgb"] = np.empty((rows * columns, 3), np.uint8)
            image.set_active_scalars("rgb")
            self._texture.SetInputData(image)
            self._image = image
        self._image.point_data["rgb"][:] = rgb.reshape(-1, 3)
        self._image.Modified()
