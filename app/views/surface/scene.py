"""A surface in 3D with its annotations, on the plotter of the window or of an image file.

The scene's frame is x right, y up (the sensor's y with its sign turned) and z towards the viewer:
depth times the exaggeration. From the top, the surface lies as in the camera's image.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
import pyvista as pv
from pyvista.core.utilities.helpers import generate_plane

from app.program.display import DisplaySettings
from gelpolight_core.base.arrays import Float64Array, PointXY, Rgb8Array

from .display_surface import LIVE_NODES, DisplaySurface, SurfaceLine
from .overlays import (
    BAR,
    BAR_HEIGHT,
    CURSOR,
    CUT,
    VIEWS,
    AxesMarks,
    Box,
    OverlayActor,
    Plotter,
    SceneColours,
    axes_marks,
    box_of,
    cut_edge,
    draw_axes,
    draw_note,
    draw_pins,
    draw_scale,
    draw_scale_bar,
    draw_solid,
    lines_mesh,
    points_on,
)
from .surface_mesh import SurfaceActor

# Around surface and axes, left and right, above and below: half of an axis' title.
MARGIN_PX = np.array([48.0, 48.0])

Clip = tuple[Float64Array, Float64Array]


class Scene:
    """Draws a surface. Camera, axes and colour scale do not move from frame to frame.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Target of the drawing. Its owner decides when to render.

    Attributes
    ----------
    surface : DisplaySurface or None
        Current surface.
    style : DisplaySettings
        Current style. A curved membrane is not stretched: its shape would be another.
    clip : (normal, origin) or None
        Plane in the scene's frame; the side that its normal points to is hidden.
    box : tuple of 6 floats
        Axes box. Empty before the first surface.
    """

    def __init__(self, plotter: Plotter) -> None:
        self._plotter = plotter
        self.surface: DisplaySurface | None = None
        self.style, self._ink = DisplaySettings(exaggeration=1.0), SceneColours()
        self._chosen = self.style
        self.clip: Clip | None = None
        self.box: Box | tuple[()] = ()
        self._sheet = SurfaceActor(plotter)
        self._lines: tuple[SurfaceLine, ...] = ()
        self._cursor: PointXY | None = None
        self._pins: tuple[tuple[PointXY, ...], str] = ((), "")
        self._solid: pv.PolyData | None = None
        self._explained: object = None
        self._laid: object = None
        self._line = OverlayActor(plotter, "lines", line_width=3)
        self._cut = OverlayActor(plotter, "cut", color=CUT, line_width=3)
        self._dot = OverlayActor(
            plotter, "cursor", color=CURSOR, point_size=11, render_points_as_spheres=True
        )

    def show_surface(self, surface: DisplaySurface) -> None:
        """Show the surface of a frame."""
        before, self.surface = self.surface, surface
        self._sheet.show(surface)
        if before is None or before.curved != surface.curved:
            self.set_style(self._chosen)
        self._explain()
        self._lay_overlays()
        if before is None:
            self.view_from("isometric")

    def coarsen(self) -> None:
        """Draw fewer nodes, to follow the mouse smoothly, until :meth:`refine`."""
        if self.surface is not None:
            self._sheet.coarsen(self.surface, LIVE_NODES)

    def refine(self) -> None:
        """Draw all nodes."""
        self._sheet.refine()

    def set_style(self, style: DisplaySettings) -> None:
        """Apply a style: visible parts and exaggeration of the depth."""
        self._chosen = style
        if self.surface is not None and self.surface.curved:
            style = replace(style, exaggeration=1.0)
        stretched, self.style = style.exaggeration != self.style.exaggeration, style
        self._plotter.camera.parallel_projection = style.parallel
        self._sheet.actor.prop.style = "wireframe" if style.wireframe else "surface"
        for actor in (self._sheet.actor, self._line.actor, self._dot.actor):
            actor.scale = (1.0, 1.0, style.exaggeration)
        self._explain()
        self._lay_overlays()
        if stretched:
            self.show_solid(self._solid)

    def set_ink(self, ink: SceneColours) -> None:
        """Set the colours of background and text."""
        self._ink = ink
        self._plotter.set_background(ink.low, top=ink.high)
        self._explain()

    def _explain(self) -> None:
        """Redraw axes, colour bar and notes if they changed."""
        surface, style = self.surface, self.style
        if surface is None:
            return
        scale = surface.scale.in_unit()
        colours = (scale.title, scale.low, scale.high, scale.names, scale.table.tobytes())
        # By the extent, not the nodes: those of a live and a frozen frame differ.
        explained = (surface.extent_mm, surface.range_mm, colours, style, self._ink)
        if explained == self._explained:
            return
        self._explained, self.box = explained, box_of(surface, style.exaggeration)
        draw_scale(self._plotter, scale, self._sheet.actor, style, self._ink)
        draw_note(self._plotter, style, self._ink, curved=surface.curved)
        draw_scale_bar(self._plotter, self.box, style, self._ink)

    def lay_axes(self) -> None:
        """Place axes and numbers for the present camera and window, before they are drawn."""
        lines = BAR_HEIGHT * self._size[1] / self._letter_px
        for bar in self._plotter.scalar_bars.values():
            bar.SetNumberOfLabels(bar.GetNumberOfLabels() and (5 if lines > 6.0 else 3))
        camera, axis = self._plotter.camera, self.surface and self.surface.axis
        view = camera.position, camera.focal_point, camera.up, camera.view_angle
        laid = self._ink, self.style, self.box, axis, view, *self._size, self._letter_px
        if laid != self._laid:
            self._laid = laid
            draw_axes(self._plotter, self._marks(), self._ink)

    def _marks(self) -> AxesMarks | None:
        if self.surface is None or not (self.box and self.style.axes):
            return None
        letters, (value, title) = 0.5 * self._size / self._letter_px, self.surface.axis
        how = value / self.style.exaggeration, title
        return axes_marks(self.box, *how, lambda points: letters * self._project(points))

    # Overlays on the surface

    def show_lines(self, lines: tuple[SurfaceLine, ...]) -> None:
        """Replace the lines on the surface."""
        self._lines = lines
        self._lay_overlays()

    def show_cursor(self, point: PointXY | None) -> None:
        """Mark a position (x, y) in mm. None: none."""
        self._cursor = point
        self._dot.show(None if point is None else self._dots([point]))

    def show_pins(self, pins: tuple[PointXY, ...], text: str) -> None:
        """Show pins, a line between two of them, and a text with their values."""
        self._pins = pins, text
        if self.surface is not None:
            points = points_on(self.surface, np.array(pins, np.float64).reshape(-1, 2))
            whole = len(points) == len(pins)
            points = points * (1.0, 1.0, self.style.exaggeration)
            draw_pins(self._plotter, points if whole else points[:0], text, self._ink)

    def show_solid(self, solid: pv.PolyData | None) -> None:
        """Show a translucent solid, in the scene's frame with exaggeration 1. None: none."""
        self._solid = solid
        draw_solid(self._plotter, solid, self.style.exaggeration)

    def clip_by(self, clip: Clip | None) -> None:
        """Hide the side of a plane that its normal points to. None: hide nothing."""
        self.clip = clip
        mapper = self._sheet.actor.mapper
        mapper.RemoveAllClippingPlanes()
        if clip is not None:
            mapper.AddClippingPlane(generate_plane(-np.asarray(clip[0]), clip[1]))
        self._lay_overlays()

    def _lay_overlays(self) -> None:
        surface = self.surface
        if surface is None:
            return
        self._line.show(lines_mesh(surface, self._lines))
        self._dot.show(None if self._cursor is None else self._dots([self._cursor]))
        cut = None
        if self.clip is not None:
            cut = cut_edge(surface, self.style.exaggeration, *self.clip)
        self._cut.show(cut)

    def _dots(self, positions: list[PointXY]) -> pv.PolyData | None:
        if self.surface is None:
            return None
        points = points_on(self.surface, np.array(positions, np.float64))
        return pv.PolyData(points.astype(np.float32)) if len(points) else None

    # The camera

    def view_from(self, view: str) -> None:
        """View the whole surface from one of VIEWS."""
        direction, up = VIEWS[view]
        self._plotter.view_vector(direction, viewup=up, render=False, bounds=self.box or None)
        self.fit()

    def fit(self) -> None:
        """Show the whole surface from the current camera direction, as large as possible."""
        surface = self.surface
        if surface is None or not self.box:
            return
        ends = surface.x_mm[:, [0, -1]].ravel()
        rims = np.column_stack([ends, -np.repeat(surface.y_mm, 2)]).astype(np.float64)
        points = np.vstack([np.insert(rims, 2, depth, axis=1) for depth in self.box[4:]])
        self._plotter.renderer.reset_camera(render=False, bounds=self.box)
        taken = np.array([BAR * self.style.colour_bar, 0.0])
        self._plotter.camera.SetWindowCenter(*-taken)
        filled = np.clip(1.0 - taken - 2.0 * MARGIN_PX / self._size, 0.4, 0.95)
        # VTK fits a sphere around the box. The rim of the surface fits closer; as moving and
        # zooming change the perspective, twice.
        for _ in range(2):
            low, high = self._seen(points)
            self._pan(0.5 * (low + high) - taken)
            low, high = self._seen(points)
            self.zoom(float(min(filled / (0.5 * (high - low)))))

    @property
    def _size(self) -> Float64Array:
        return np.maximum(np.asarray(self._plotter.window_size, np.float64), 1.0)  # 0 if unshown

    @property
    def _letter_px(self) -> float:
        return float((self._ink.font + 1) * self._plotter.render_window.GetDPI() / 72.0)

    def _project(self, points: Float64Array) -> Float64Array:
        """Return where points (N, 3) of the scene are in the window, -1 to 1."""
        renderer, camera = self._plotter.renderer, self._plotter.camera
        matrix: Float64Array = pv.array_from_vtkmatrix(
            camera.GetCompositeProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1, 1)
        )
        clip = np.insert(points, 3, 1.0, axis=1) @ matrix.T
        return np.asarray(clip[:, :2] / clip[:, 3:])

    def _seen(self, points: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Return where points and the labels of the axes begin and end in the window."""
        if (marks := self._marks()) is not None:
            points = np.vstack([points, marks[1]])
        shares = self._project(points)
        return shares.min(axis=0), shares.max(axis=0)

    def _pan(self, by: Float64Array) -> None:
        """Move the camera sideways, so that this place of the window, -1 to 1, is in the middle."""
        camera = self._plotter.camera
        half = camera.distance * np.tan(np.radians(0.5 * camera.view_angle))
        if camera.parallel_projection:
            half = camera.parallel_scale
        along = np.array(camera.direction)
        right = np.cross(along, camera.up)
        right /= np.linalg.norm(right)
        aspect = self._plotter.renderer.GetTiledAspectRatio()
        move = half * (by[0] * aspect * right + by[1] * np.cross(right, along))
        camera.position = np.array(camera.position) + move
        camera.focal_point = np.array(camera.focal_point) + move

    def zoom(self, factor: float) -> None:
        """Zoom by a factor."""
        camera = self._plotter.camera
        if camera.parallel_projection:
            camera.parallel_scale /= factor
        else:
            camera.Dolly(factor)
        self._plotter.renderer.ResetCameraClippingRange()

    def copy_to(self, other: Scene, ink: SceneColours | None = None) -> None:
        """Show the same content in another scene, from the same viewpoint."""
        other.set_ink(ink or self._ink)
        if self.surface is not None:
            other.show_surface(self.surface)
        other.set_style(self._chosen)
        other.show_lines(self._lines)
        other.show_pins(*self._pins)
        other.show_solid(self._solid)
        other.clip_by(self.clip)
        other._plotter.camera.DeepCopy(self._plotter.camera)
        other._plotter.renderer.ResetCameraClippingRange()


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
        self.scene.lay_axes()
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
