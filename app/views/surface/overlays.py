"""Overlays on the 3D surface: lines, cursor, pins, a fitted solid, the edge of the clip plane."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv
from matplotlib import get_data_path
from pyvista.plotting import BasePlotter
from vtkmodules.vtkCommonCore import VTK_FONT_FILE

from app.program.display import DisplaySettings
from app.widgets.units import length_text, round_length_mm, round_up
from gelpolight_core.base.arrays import Float64Array

from .display_surface import PIN_NAMES, ColourScale, DisplaySurface, SurfaceLine, densify_line
from .surface_mesh import SurfaceMesh

Vector = tuple[float, float, float]
Project: TypeAlias = Callable[[Float64Array], Float64Array]

VIEWS: dict[str, tuple[Vector, Vector]] = {
    "isometric": ((-0.55, -1.0, 0.8), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Direction from surface to camera, and up direction. Front is the lower edge of the image."""


@dataclass(frozen=True, slots=True)
class SceneColours:
    """Colours of the background, from bottom to top, and of text, and the size of letters."""

    low: str = "white"
    high: str = "white"
    text: str = "black"
    font: int = 11


FONT = str(Path(get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"))
"""VTK's own letters differ from those of the program and of its reports."""
CURSOR = "white"
PIN = "#ffb02e"
CUT = "#ff5ac8"
SOLID = "#5fd0ff"
QUIET: dict[str, Any] = {"reset_camera": False, "render": False}
"""Added to the scene without moving the camera or drawing at once."""
PLAIN = {**QUIET, "lighting": False}
PLATE = 0.7
"""Opacity of the plates behind letters."""
BAR, BAR_HEIGHT = 0.135, 0.38
"""Share of the view, from the left, in which the colour bar lies: the axes begin beside it; and the
share of its height."""
LIFT = 0.001
"""Lines lie above the surface by this share of its width, so that it does not cover them."""


def points_on(surface: DisplaySurface, points_mm: Float64Array) -> Float64Array:
    """Return points (N, 2) on the surface as points (M, 3) of the scene, exaggeration 1."""
    depth = surface.depth_at(points_mm[:, 0], points_mm[:, 1])
    return np.stack([points_mm[:, 0], -points_mm[:, 1], depth], axis=-1)[np.isfinite(depth)]


def lines_mesh(surface: DisplaySurface, lines: tuple[SurfaceLine, ...]) -> pv.PolyData | None:
    """Return lines that follow the relief, with a colour per line. None if there is none."""
    parts = [(points_on(surface, densify_line(line.points_mm)), line.colour) for line in lines]
    parts = [(points, colour) for points, colour in parts if len(points) > 1]
    if not parts:
        return None
    firsts = np.cumsum([0, *(len(points) for points, _ in parts)])
    cells = [np.insert(np.arange(a, b), 0, b - a) for a, b in itertools.pairwise(firsts)]
    points = np.concatenate([points for points, _ in parts]).astype(np.float32)
    points[:, 2] += LIFT * np.ptp(surface.x_mm)
    mesh = pv.PolyData(points, lines=np.concatenate(cells))
    mesh.cell_data["rgb"] = np.array([pv.Color(c).int_rgb for _, c in parts], np.uint8)
    return mesh


def cut_edge(
    surface: DisplaySurface, exaggeration: float, normal: Float64Array, origin: Float64Array
) -> pv.PolyData:
    """Return the line where a plane of the scene cuts the surface."""
    sheet = SurfaceMesh()
    sheet.show(surface.thinned(256))
    mesh = sheet.mesh.triangulate().scale((1.0, 1.0, exaggeration))
    return mesh.slice(normal=tuple(normal), origin=tuple(origin))


class OverlayActor:
    """An actor on the surface whose mesh is replaced. Rounding errors do not hide it."""

    def __init__(self, plotter: Plotter, name: str, **how: object) -> None:
        self.actor = plotter.add_mesh(
            pv.PolyData(np.zeros((1, 3), np.float32)),
            name=name,
            pickable=False,
            show_scalar_bar=False,
            **PLAIN,
            **how,
        )
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


def draw_pins(plotter: Plotter, points: Float64Array, text: str, ink: SceneColours) -> None:
    """Draw points A and B of the scene with a line between them, and a text next to them."""
    _remove(plotter, "pins", "pin-line", "pin-text")
    if not len(points):
        return
    names, dots = list(PIN_NAMES[: len(points)]), {"point_color": PIN, "point_size": 10}
    plates = {"shape_color": PIN, "shape_opacity": 1.0, "margin": 3, "text_color": "black"}
    how = {"render_points_as_spheres": True, "always_visible": True, "font_size": ink.font + 1}
    plates["font_file"] = FONT
    plotter.add_point_labels(points, names, name="pins", **dots, **plates, **how, **QUIET)
    _write(plotter, "pin-text", text, "lower_right", ink)
    if len(points) == len(PIN_NAMES):
        plotter.add_mesh(pv.Line(*points), name="pin-line", color=PIN, line_width=3, **PLAIN)


def draw_solid(plotter: Plotter, solid: pv.PolyData | None, exaggeration: float) -> None:
    """Draw a translucent solid with its edges. None: none."""
    _remove(plotter, "solid", "solid-edges")
    if solid is None:
        return
    rims = solid.extract_feature_edges(40.0)
    body = plotter.add_mesh(solid, name="solid", opacity=0.3, color=SOLID, **PLAIN)
    edges = plotter.add_mesh(rims, name="solid-edges", line_width=2, color=SOLID, **PLAIN)
    for actor in (body, edges):
        actor.scale = (1.0, 1.0, exaggeration)


Box = tuple[float, float, float, float, float, float]
Plotter: TypeAlias = BasePlotter


def box_of(surface: DisplaySurface, exaggeration: float) -> Box:
    """Return the box of a surface in the scene's frame. It follows its range, not its depth."""
    left, right = float(surface.x_mm.min()), float(surface.x_mm.max())
    near, far = -float(surface.y_mm[-1]), -float(surface.y_mm[0])
    low, high = surface.range_mm
    return left, right, near, far, exaggeration * min(low, 0.0), exaggeration * high


AxesMarks = tuple[Float64Array, Float64Array, list[str]]
# Room of a number with a gap, and the width of a letter, in sizes of a letter.
NUMBER, LETTER = np.array([2.5, 1.25]), 0.6


def draw_axes(plotter: Plotter, marks: AxesMarks | None, ink: SceneColours) -> None:
    """Draw axes with upright labels. One that would cover another one is left out. None: none."""
    _remove(plotter, "axes", "axes-labels")
    ends, points, texts = marks or ((), (), [])
    if marks is not None:
        lines = pv.line_segments_from_points(ends)
        plotter.add_mesh(lines, name="axes", color=ink.text, line_width=1, **PLAIN)
    if texts:
        how: dict[str, Any] = {
            f"justification_{side}": "center" for side in ("horizontal", "vertical")
        }
        how |= {"text_color": ink.text, "bold": False}
        _label(plotter, "axes-labels", points, texts, ink.font + 1, **how)


def axes_marks(box: Box, scale: float, title: str, project: Project) -> AxesMarks:
    """Return the lines of the axes with their ticks, and the places and texts of the labels.

    The values are true: the sensor's y, and depth that is not exaggerated. Their steps follow from
    the length of the axis as it is seen, so that numbers have room beside each other. An axis that
    lies on a longer one, or is seen end-on, has none.

    Parameters
    ----------
    box : Box
        Its edges are the axes.
    scale : float
        Value of a place of 1 on the upright axis.
    title : str
        Its title.
    project : callable
        Returns where points (N, 3) of the scene are seen (N, 2), in sizes of a letter.
    """
    left, right, near, far, low = box[:5]
    width, depth, height = np.diff(np.reshape(box, (3, 2))) * np.eye(3)
    foot = np.array([[left, near, low], [right, near, low], [left, far, low], [right, far, low]])
    # x and y lie along the lower edges of the view, which the surface does not cover.
    levels = project(foot)[:, 1].round(2).reshape(2, 2)
    back, aside = (int(levels.sum(axis=k).argmin()) for k in (1, 0))
    out_x, out_y, down = np.array([2 * aside - 1, 2 * back - 1, -1])[:, None] * np.eye(3)
    # Start and vector of each axis, sides for its labels, value of a place of 1, title.
    axes = (
        (foot[2 * back], width, np.array([out_y, down]), 1.0, "x (mm)"),
        (foot[aside], depth, np.array([out_x, down]), -1.0, "y (mm)"),
        (foot[2 * back + 1 - aside], height, np.array([-out_x, out_y]), scale, title),
    )
    ends = np.concatenate([[start, start + axis] for start, axis, *_ in axes])
    ticks, points, texts = [ends], list[Float64Array](), list[str]()
    seen = np.diff(project(ends).reshape(3, 2, 2), axis=1)[:, 0]
    lengths = np.maximum(np.hypot(*seen.T), 1e-9)  # 0 end-on
    for number, (start, axis, sides, value, name) in enumerate(axes):
        along, named = seen[number], np.array([LETTER * len(name), NUMBER[1]])
        across, longer = along[::-1] * (-1.0, 1.0) / lengths[number], lengths > lengths[number]
        lowest, highest = sorted(value * ends[2 * number : 2 * number + 2, number])
        with np.errstate(divide="ignore", over="ignore"):  # upright or level
            apart, above = np.min([NUMBER, 0.5 * (NUMBER + named)] / np.abs(along), axis=1)
        step = round_up(apart * (highest - lowest))
        away = lengths[number] * np.abs(seen @ across)[longer] / lengths[longer]
        if not 0.0 < step <= highest - lowest or (away < NUMBER[1]).any():
            continue
        # Numbers and title are two bands beside the axis, on the side that is seen longest.
        middle = start + 0.5 * axis
        reach = np.abs((project(middle + sides) - project(middle[None])) @ across)
        out = sides[reach.argmax()] / reach.max()
        tall, taller = (0.5 * np.abs(across) @ room for room in (NUMBER, named))
        amounts = step * np.arange(np.ceil(lowest / step - 1e-6), highest / step + 1e-6)
        at = np.where(np.eye(3)[number], amounts[:, None] / value, start)
        ticks += [np.hstack([at, at + 0.5 * tall * out]).reshape(-1, 3)]
        beside = middle + (2.5 * tall + taller) * out
        titled = start + (1.0 + above) * axis if number == 2 else beside  # it may be short
        points += [*(at + 1.5 * tall * out), titled]
        texts += [*(f"{amount + 0.0:.4g}" for amount in amounts), name]
    return np.concatenate(ticks), np.array(points).reshape(-1, 3), texts


def draw_scale(
    plotter: Plotter, scale: ColourScale, actor: pv.Actor, style: DisplaySettings, ink: SceneColours
) -> None:
    """Draw the colour bar with values, or with the names of its colours."""
    for title in list(plotter.scalar_bars.keys()):
        plotter.remove_scalar_bar(title, render=False)
    if not style.colour_bar:
        return
    colours = np.array([colour for _, colour in scale.names]) if scale.names else scale.table
    low, high = (0.0, float(len(colours))) if scale.names else (scale.low, scale.high)
    mapper = actor.mapper
    table = np.insert(colours, 3, 255, axis=1)
    mapper.lookup_table = pv.LookupTable(values=table, scalar_range=(low, high))
    mapper.lookup_table.annotations = {k + 0.5: name for k, (name, _) in enumerate(scale.names)}
    mapper.scalar_visibility = False  # the texture contains the colours
    title = scale.title.replace(" (", "\n(")  # the unit on a line of its own, for narrow views
    numbers = {"n_labels": 0 if scale.names else 5, "fmt": "{:.4g}"}
    place = {"position_x": 0.015, "position_y": 0.56, "width": BAR - 0.015, "height": BAR_HEIGHT}
    sizes = {"title_font_size": ink.font + 1, "label_font_size": ink.font + 1}
    how = {"vertical": True, "color": ink.text, "unconstrained_font_size": True, "render": False}
    bar = plotter.add_scalar_bar(title, mapper=mapper, **numbers, **place, **sizes, **how)
    bar.SetBarRatio(0.25)
    bar.SetDrawAnnotations(bool(scale.names))
    if scale.names:
        bar.SetTextPositionToPrecedeScalarBar()  # puts the names on the other side
    names = bar.GetAnnotationTextProperty()
    names.SetFontSize(ink.font)
    names.SetColor(pv.Color(ink.text).float_rgb)
    for letters in (names, bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        letters.SetFontFamily(VTK_FONT_FILE)
        letters.SetFontFile(FONT)
        _back(letters, ink)


def draw_note(plotter: Plotter, style: DisplaySettings, ink: SceneColours, *, curved: bool) -> None:
    """Show the exaggeration of the depth, unless it is 1, or that the membrane is curved."""
    _remove(plotter, "note")
    if curved or style.exaggeration != 1.0:
        text = f"Depth scaled {style.exaggeration:g} times"
        if curved:
            text = "Curved membrane, not scaled"
        _write(plotter, "note", text, "lower_left", ink)


def draw_scale_bar(plotter: Plotter, box: Box, style: DisplaySettings, ink: SceneColours) -> None:
    """Draw a bar of round length at the foot of the box, below the surface's lower edge."""
    _remove(plotter, "scale-bar", "scale-bar-length")
    if not style.scale_bar:
        return
    length = round_length_mm(0.25 * (box[1] - box[0]))
    side = box[3] - box[2]
    y = box[2] - 0.22 * side
    line = pv.Line((box[0], y, box[4]), (box[0] + length, y, box[4]))
    plotter.add_mesh(line, name="scale-bar", color=ink.text, line_width=4, **PLAIN)
    at, text = [(box[0] + 0.5 * length, y - 0.07 * side, box[4])], [length_text(length)]
    _label(plotter, "scale-bar-length", at, text, ink.font + 4, text_color=ink.text)


def _remove(plotter: Plotter, *names: str) -> None:
    for name in names:
        plotter.remove_actor(name, render=False)


def _write(plotter: Plotter, name: str, text: str, place: str, ink: SceneColours) -> None:
    how = {"position": place, "color": ink.text, "font_file": FONT}
    actor = plotter.add_text(text, name=name, render=False, **how)
    actor.SetMaximumFontSize(ink.font + 1)  # else the letters grow with the window
    _back(actor.GetTextProperty(), ink)


def _back(letters: Any, ink: SceneColours) -> None:
    """Put a plate behind letters, whose colour could not be read over the surface."""
    letters.SetBackgroundColor(pv.Color(ink.high).float_rgb)
    letters.SetBackgroundOpacity(PLATE)


def _label(plotter: Plotter, name: str, at: Any, texts: list[str], size: int, **how: Any) -> None:
    options = {"shape": None, "show_points": False, "font_size": size, "font_file": FONT}
    plotter.add_point_labels(at, texts, name=name, always_visible=True, **options, **how, **QUIET)
