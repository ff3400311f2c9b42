"""The surface in VTK: triangle strips with a shaded texture, drawn off the screen.

VTK draws into its own buffer and the widget paints what was drawn. Qt knows nothing of OpenGL
then: the window needs not be built anew when the first 3D view comes, other views are painted as
before, and there is one rendering for each picture shown. Points and texture are written in place.
"""

from __future__ import annotations

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  makes the classes below draw
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkTexture,
)

from app.inspect.camera3d import Camera
from app.inspect.surface import Surface
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


def strips(rows: int, columns: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return triangle strips between the rows of a grid of nodes.

    Returns
    -------
    offsets : (strips + 1,)
    nodes : (points,)
        Numbers of nodes, in turn of the upper and the lower row of each strip.
    """
    upper = np.arange((rows - 1) * columns, dtype=np.int64)
    nodes = np.stack([upper, upper + columns], axis=-1).ravel()
    return np.arange(rows, dtype=np.int64) * 2 * columns, nodes


class SurfaceActor:
    """A surface whose depth and texture follow the frames."""

    def __init__(self) -> None:
        self._nodes = np.zeros((0, 0), np.float32)
        self._points = vtkPoints()
        self._heights = np.zeros((0, 3), np.float32)
        self._pixels = np.zeros((0, 3), np.uint8)
        self._poly, self._image = vtkPolyData(), vtkImageData()
        self._poly.SetPoints(self._points)
        texture = vtkTexture()
        texture.SetInputData(self._image)
        texture.InterpolateOn()
        texture.SetColorModeToDirectScalars()
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._poly)
        self.actor = vtkActor()
        self.actor.SetMapper(mapper)
        self.actor.SetTexture(texture)
        # The light is in the texture already.
        self.actor.GetProperty().LightingOff()

    def show(self, surface: Surface) -> None:
        """Take the depth and colours of a frame."""
        if not np.array_equal(surface.x_mm, self._nodes):
            self._nodes = surface.x_mm
            self._build(surface)
        self._heights[:, 2] = surface.depth_mm.ravel()
        self._points.GetData().Modified()
        self._points.Modified()
        shape = surface.texture.shape[1::-1]
        if self._image.GetDimensions()[:2] != shape:
            self._image.SetDimensions(*shape, 1)
            array = numpy_to_vtk(np.empty((shape[0] * shape[1], 3), np.uint8), deep=True)
            self._image.GetPointData().SetScalars(array)
            self._pixels = vtk_to_numpy(array)
        self._pixels[:] = surface.texture.reshape(-1, 3)
        self._image.GetPointData().GetScalars().Modified()
        self._image.Modified()

    def _build(self, surface: Surface) -> None:
        rows, columns = surface.depth_mm.shape
        left, top, right, bottom = surface.extent_mm
        x = surface.x_mm
        y = np.broadcast_to(surface.y_mm[:, None], x.shape)
        places = np.stack([x, -y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
        array = numpy_to_vtk(places, deep=True)
        self._points.SetData(array)
        self._heights = vtk_to_numpy(array)
        s, t = (x - left) / (right - left), (y - top) / (bottom - top)
        corners = np.stack([s, t], axis=-1).reshape(-1, 2).astype(np.float32)
        self._poly.GetPointData().SetTCoords(numpy_to_vtk(corners, deep=True))
        offsets, nodes = strips(rows, columns)
        cells = vtkCellArray()
        cells.SetData(
            numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(nodes, deep=True)
        )
        self._poly.SetStrips(cells)


class Scene:
    """The 3D scene: one surface, one camera.

    Raises
    ------
    InputError
        Where this machine cannot draw in 3D.
    """

    def __init__(self) -> None:
        self.surface = SurfaceActor()
        self._renderer = vtkRenderer()
        self._renderer.AddActor(self.surface.actor)
        self._renderer.GradientBackgroundOn()
        self._window = vtkRenderWindow()
        self._window.SetOffScreenRendering(1)
        self._window.SetMultiSamples(0)
        self._window.AddRenderer(self._renderer)
        self._pixels = vtkUnsignedCharArray()
        if not self._window.SupportsOpenGL():
            raise InputError(
                tr("OpenGL 3.2 is not to be had here"),
                where=tr("3D view"),
                advice=tr("Install the graphics driver, or Mesa (libgl1-mesa-dri)"),
            )

    def set_background(self, low: tuple[float, ...], high: tuple[float, ...]) -> None:
        """Choose the colours behind the surface, 0..1, below and above."""
        self._renderer.SetBackground(*low)
        self._renderer.SetBackground2(*high)

    def draw(self, camera: Camera, size: tuple[int, int], exaggeration: float) -> NDArray[np.uint8]:
        """Draw, and return the picture (height, width, 3)."""
        width, height = size
        if tuple(self._window.GetSize()) != size:
            self._window.SetSize(width, height)
        self.surface.actor.SetScale(1.0, 1.0, exaggeration)
        view = self._renderer.GetActiveCamera()
        view.SetPosition(*camera.position())
        view.SetFocalPoint(*camera.focus)
        view.SetViewUp(*camera.up())
        view.SetViewAngle(camera.view_angle_deg)
        view.SetClippingRange(*camera.clipping())
        self._window.Render()
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._pixels, 0)
        picture = vtk_to_numpy(self._pixels).reshape(height, width, 3)
        return np.ascontiguousarray(picture[::-1])

    def close(self) -> None:
        """Give the graphics memory back."""
        self._window.Finalize()
