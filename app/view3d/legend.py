"""Annotations of a 3D surface: axes box in mm, colour bar or legend, notes, scale bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from pyvista.plotting import BasePlotter
from vtkmodules.vtkCommonCore import vtkStringArray

from app.view3d.style import Ink, Style, ticks
from app.view3d.surface import ColourScale, Surface
from app.widgets.units import length_text, round_length_mm
from gelpolight_core.translation import tr

Box = tuple[float, float, float, float, float, float]
Plotter = BasePlotter
TICKS = 8  # with at most ten, VTK places labels where we want them
COLOUR_TICKS = 5
FONT = 11


@dataclass(frozen=True, slots=True)
class Axes:
    """Ticks of the axes box in mm, sensor frame, and the box in the scene's frame."""

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    depth_mm: tuple[float, ...]
    box: Box


def axes_of(surface: Surface, exaggeration: float) -> Axes:
    """Return axes with round ticks that contain a surface. They follow its range, not its depth."""
    x = ticks(float(surface.x_mm.min()), float(surface.x_mm.max()), TICKS)
    y = ticks(float(surface.y_mm[0]), float(surface.y_mm[-1]), TICKS)
    low, high = surface.range_mm
    # A low box has space for few depth ticks.
    height = exaggeration * (high - min(low, 0.0)) / (x[-1] - x[0])
    most = 2 if height < 0.15 and low >= 0.0 else 3 if height < 0.3 else TICKS
    depth = ticks(min(low, 0.0), high, most)
    box = (x[0], x[-1], -y[-1], -y[0], exaggeration * depth[0], exaggeration * depth[-1])
    return Axes(x, y, depth, box)


def draw_axes(plotter: Plotter, axes: Axes, style: Style, ink: Ink) -> None:
    """Draw the axes box with true values: the sensor's y, and depth without exaggeration."""
    plotter.remove_bounds_axes()
    if not style.axes:
        return
    actor = plotter.show_bounds(
        bounds=axes.box, grid="back", location="outer", xtitle=tr("x [mm]"), ytitle=tr("y [mm]"),
        ztitle=tr("depth [mm]"), font_size=FONT, bold=False, color=ink.text, ticks="outside",
        padding=0.0, render=False,
    )  # fmt: skip
    # VTK chooses its own round values and cannot count down. With a given number of intervals it
    # puts ticks where we want them; the labels show the values.
    rising = (axes.x_mm, axes.y_mm[::-1], axes.depth_mm)
    for number, (name, values) in enumerate(zip("XYZ", rising, strict=True)):
        getattr(actor, f"Set{name}AxisRange")(0.0, float(len(values) - 1))
        getattr(actor, f"Get{name}AxesGridlinesProperty")().SetColor(pv.Color(ink.grid).float_rgb)
        labels = vtkStringArray()
        for value in values:
            labels.InsertNextValue(f"{value:.4g}")
        actor.SetAxisLabels(number, labels)


def draw_scale(
    plotter: Plotter, scale: ColourScale, actor: pv.Actor, style: Style, ink: Ink
) -> None:
    """Draw the colour bar with values, or with the names of its colours."""
    for title in list(plotter.scalar_bars.keys()):
        plotter.remove_scalar_bar(title, render=False)
    if not style.colour_bar:
        return
    colours = np.array([colour for _, colour in scale.names]) if scale.names else scale.table
    low, high = (0.0, float(len(colours))) if scale.names else (scale.low, scale.high)
    mapper = actor.mapper
    mapper.lookup_table = pv.LookupTable(
        values=np.insert(colours, 3, 255, axis=1), scalar_range=(low, high)
    )
    mapper.lookup_table.annotations = {
        number + 0.5: name for number, (name, _) in enumerate(scale.names)
    }
    mapper.scalar_visibility = False  # the texture contains the colours
    title = scale.title.replace(" [", "\n[")  # the unit on a line of its own, for narrow views
    bar = plotter.add_scalar_bar(
        title, mapper=mapper, vertical=True, n_labels=0 if scale.names else COLOUR_TICKS,
        fmt="{:.4g}", color=ink.text, position_x=0.015, position_y=0.42, width=0.17, height=0.54,
        title_font_size=FONT + 1, label_font_size=FONT + 1, unconstrained_font_size=True,
        render=False,
    )  # fmt: skip
    bar.SetBarRatio(0.2)
    bar.SetDrawAnnotations(bool(scale.names))
    if scale.names:
        bar.SetTextPositionToPrecedeScalarBar()  # puts the names on the other side
    bar.GetAnnotationTextProperty().SetFontSize(FONT)
    bar.GetAnnotationTextProperty().SetColor(pv.Color(ink.text).float_rgb)


def draw_note(plotter: Plotter, style: Style, ink: Ink) -> None:
    """Show the exaggeration of the depth, unless it is 1."""
    plotter.remove_actor("note", render=False)
    if style.exaggeration != 1.0:
        plotter.add_text(
            tr("Depth scaled {k:g} times").format(k=style.exaggeration), position="lower_left",
            font_size=FONT - 3, color=ink.text, name="note", render=False,
        )  # fmt: skip


def draw_scale_bar(plotter: Plotter, box: Box, style: Style, ink: Ink) -> None:
    """Draw a bar of round length in the membrane's plane, below the surface's lower edge."""
    for name in ("scale-bar", "scale-bar-length"):
        plotter.remove_actor(name, render=False)
    if not style.scale_bar:
        return
    length = round_length_mm(0.25 * (box[1] - box[0]))
    side = box[3] - box[2]
    y = box[2] - 0.22 * side
    plotter.add_mesh(
        pv.Line((box[0], y, 0.0), (box[0] + length, y, 0.0)), color=ink.text, line_width=4,
        lighting=False, name="scale-bar", reset_camera=False, render=False,
    )  # fmt: skip
    plotter.add_point_labels(
        [(box[0] + 0.5 * length, y - 0.07 * side, 0.0)], [length_text(length)],
        shape=None,
        name="scale-bar-length", font_size=FONT + 4, text_color=ink.text, show_points=False,
        always_visible=True, reset_camera=False, render=False,
    )  # fmt: skip
