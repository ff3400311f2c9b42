"""Overlays on the 3D surface: lines, cursor, pins, a fitted solid, the edge of the clip plane."""

from __future__ import annotations

import itertools

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from app.view3d.legend import FONT, Plotter
from app.view3d.picking import PIN_NAMES, along
from app.view3d.sheet import Sheet
from app.view3d.style import Ink
from app.view3d.surface import Surface, SurfaceLine

Array = NDArray[np.float64]
CURSOR = "white"
PIN = "#ffb02e"
CUT = "#ff5ac8"
SOLID = "#5fd0ff"
CUT_NODES = 256


def points_on(surface: Surface, points_mm: Array) -> Array:
    """Return points (N, 2) on the surface as points (M, 3) of the scene, exaggeration 1."""
    depth = surface.depth_at(points_mm[:, 0], points_mm[:, 1])
    return np.stack([points_mm[:, 0], -points_mm[:, 1], depth], axis=-1)[np.isfinite(depth)]


def lines_mesh(surface: Surface, lines: tuple[SurfaceLine, ...]) -> pv.PolyData | None:
    """Return lines that follow the relief, with a colour per line. None if there is none."""
    parts = [(points_on(surface, along(line.points_mm)), line.colour) for line in lines]
    parts = [(points, colour) for points, colour in parts if len(points) > 1]
    if not parts:
        return None
    firsts = np.cumsum([0, *(len(points) for points, _ in parts)])
    cells = [np.insert(np.arange(a, b), 0, b - a) for a, b in itertools.pairwise(firsts)]
    points = np.concatenate([points for points, _ in parts]).astype(np.float32)
    mesh = pv.PolyData(points, lines=np.concatenate(cells))
    mesh.cell_data["rgb"] = np.array([pv.Color(c).int_rgb for _, c in parts], np.uint8)
    return mesh


def cut_edge(surface: Surface, exaggeration: float, normal: Array, origin: Array) -> pv.PolyData:
    """Return the line where a plane of the scene cuts the surface."""
    sheet = Sheet()
    sheet.show(surface.thinned(CUT_NODES))
    mesh = sheet.mesh.triangulate().scale((1.0, 1.0, exaggeration))
    return mesh.slice(normal=tuple(normal), origin=tuple(origin))


class Overlay:
    """An actor on the surface whose mesh is replaced. Rounding errors do not hide it."""

    def __init__(self, plotter: Plotter, name: str, **how: object) -> None:
        empty = pv.PolyData(np.zeros((1, 3), np.float32))
        self.actor = plotter.add_mesh(
            empty, name=name, lighting=False, pickable=False, reset_camera=False, render=False,
            show_scalar_bar=False, **how,
        )  # fmt: skip
        self.actor.visibility = False
        mapper = self.actor.mapper
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -12.0)
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-12.0)

    def show(self, mesh: pv.PolyData | None) -> None:
        """Show a mesh. None: nothing."""
        self.actor.visibility = mesh is not None and mesh.n_points > 0
        if mesh is not None and mesh.n_points > 0:
            mapper = self.actor.mapper
            mapper.SetInputData(mesh)
            if "rgb" in mesh.cell_data:
                mapper.SetScalarModeToUseCellFieldData()
                mapper.SelectColorArray("rgb")
                mapper.SetColorModeToDirectScalars()
                mapper.ScalarVisibilityOn()


def draw_pins(plotter: Plotter, points: Array, text: str, ink: Ink) -> None:
    """Draw points A and B of the scene with a line between them, and a text next to them."""
    for name in ("pins", "pin-line", "pin-text"):
        plotter.remove_actor(name, render=False)
    if not len(points):
        return
    plotter.add_point_labels(
        points, list(PIN_NAMES[: len(points)]), name="pins", point_color=PIN, point_size=10,
        shape_color=PIN, shape_opacity=1.0, render_points_as_spheres=True, always_visible=True,
        font_size=FONT + 1, text_color="black", margin=3, reset_camera=False, render=False,
    )  # fmt: skip
    plotter.add_text(
        text, position="lower_right", font_size=FONT - 2, color=ink.text, name="pin-text",
        render=False,
    )  # fmt: skip
    if len(points) == len(PIN_NAMES):
        plotter.add_mesh(
            pv.Line(*points), color=PIN, line_width=3, lighting=False, name="pin-line",
            reset_camera=False, render=False,
        )  # fmt: skip


def draw_solid(plotter: Plotter, solid: pv.PolyData | None, exaggeration: float) -> None:
    """Draw a translucent solid with its edges. None: none."""
    for name in ("solid", "solid-edges"):
        plotter.remove_actor(name, render=False)
    if solid is None:
        return
    how = {"color": SOLID, "lighting": False, "reset_camera": False, "render": False}
    body = plotter.add_mesh(solid, name="solid", opacity=0.3, **how)
    edges = plotter.add_mesh(
        solid.extract_feature_edges(40.0), name="solid-edges", line_width=2, **how
    )
    for actor in (body, edges):
        actor.scale = (1.0, 1.0, exaggeration)
