"""What all drawings of the report share: size, style, images and maps in millimetres."""

from __future__ import annotations

import functools
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.geometry.resampling import MembraneGrid
from gelpolight_core.output.drawing_thread import (
    Axes,
    Figure,
    FigureCanvasAgg,
    FigureCanvasSVG,
    ListedColormap,
    get_data_path,
    get_font,
    in_drawing_thread,
    rc_context,
)

from .document import ReportDrawing

P = ParamSpec("P")
ColourTable = NDArray[np.uint8]
FULL_MM = 178.0
"""Width between the margins of the page; see ``report.typ``."""
FONTS = Path(get_data_path()) / "fonts" / "ttf"
COLOURS = ("#c62828", "#2e7d32", "#1f4fbf")
MARKERS = ("o", "s", "^")
"""A marker shape for each channel, for colour-blind readers and grey printers."""
ACCENT = "#e69f00"
ACROSS = 6
"""Images side by side."""
MAP_PX = 280
"""Width of each of three maps side by side: 150 points an inch."""
MAP_PLACES = {"left": 0.072, "right": 0.898, "bottom": 0.17, "top": 0.89, "wspace": 0.07}
SCALE_PLACE = (0.912, 0.17, 0.012, 0.72)
"""Three maps side by side and their scale, as parts of the figure."""
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.4",
    "axes.linewidth": 0.7,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    # Maps and images are shown with their own pixels.
    "image.interpolation": "none",
    "svg.fonttype": "none",
    # The same names in every file.
    "svg.hashsalt": "report",
    # File names may contain dollar signs.
    "text.parse_math": False,
}


def drawing(
    height_mm: float, width_mm: float = FULL_MM
) -> Callable[[Callable[Concatenate[Figure, P], str]], Callable[P, ReportDrawing]]:
    """Decorate a function that paints on a figure and returns its caption: it returns a drawing.

    Parameters
    ----------
    height_mm, width_mm : float
        Size of the figure on paper.
    """

    def decorate(paint: Callable[Concatenate[Figure, P], str]) -> Callable[P, ReportDrawing]:
        @functools.wraps(paint)
        @in_drawing_thread
        def drawn(*arguments: P.args, **named: P.kwargs) -> ReportDrawing:
            with rc_context(_STYLE):
                size_inch = (width_mm / 25.4, height_mm / 25.4)
                figure = Figure(figsize=size_inch, layout="constrained")
                FigureCanvasSVG(figure)
                caption, stream = paint(figure, *arguments, **named), io.StringIO()
                if figure.axes and (layout := figure.get_layout_engine()):
                    layout.execute(figure)
                    figure.set_layout_engine(None)  # which savefig would draw everything for
                figure.savefig(stream, format="svg", metadata={"Date": None})
            return ReportDrawing(caption, stream.getvalue())

        return drawn

    return decorate


@in_drawing_thread
def png(paint: Callable[[Figure], object], width_in: float, height_in: float) -> bytes:
    """Return what `paint` draws on an empty figure of the given size, as PNG."""
    stream = io.BytesIO()
    with rc_context({"axes.formatter.min_exponent": 4}):  # writes 10 and 0.1 instead of powers
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
        paint(figure)
        figure.savefig(stream, format="png", dpi=150)
    return stream.getvalue()


@functools.cache
def _characters() -> frozenset[int]:
    return frozenset(get_font(str(FONTS / "DejaVuSans.ttf")).get_charmap())


def printable(text: str) -> str:
    """Return text on one line, with a white square for every character that the font lacks."""
    line, characters = " ".join(text.split()), _characters()
    return "".join(c if ord(c) in characters else "\N{WHITE SQUARE}" for c in line)


def round_to_one_digit(value: float) -> float:
    """Return a positive value rounded to one significant digit, for magnifications."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(round(value / power), 1) * power


def show_image(
    axes: Axes, rgb: Float32Array, *, width_px: int = 900, extent: Sequence[float] = ()
) -> None:
    """Show a linear image with the screen's gamma, in its own pixel coordinates or `extent`."""
    rows, columns = rgb.shape[:2]
    reduced = rgb
    if columns > width_px:
        size = (width_px, max(round(rows * width_px / columns), 1))
        reduced = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.float32)
    left, right, bottom, top = extent or (-0.5, columns - 0.5, rows - 0.5, -0.5)
    encoded = np.round(255.0 * np.clip(reduced, 0.0, 1.0) ** (1 / 2.2)).astype(np.uint8)
    axes.imshow(encoded, extent=(left, right, bottom, top))
    axes.set_axis_off()


def image_axes(figure: Figure, count: int, ratio: float) -> list[Axes]:
    """Return axes for images side by side, each `ratio` times as high as wide with its title."""
    rows = math.ceil(count / ACROSS)
    width, tallest = figure.get_size_inches()
    figure.set_figheight(min(rows * ratio * width / ACROSS, tallest))
    panels = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    for axes in panels:
        axes.set_axis_off()
    return list(panels[:count])


def grid_extent(grid: MembraneGrid) -> tuple[float, float, float, float]:
    """Return a map's edges in mm for matplotlib, with y downwards as in the image."""
    half = 0.5 * grid.pitch_mm
    x, y = grid.x_mm, grid.y_mm
    return float(x[0] - half), float(x[-1] + half), float(y[-1] + half), float(y[0] - half)


def colour_map(colours: ColourTable | None) -> str | ListedColormap:
    """Return a colour table (256, 3) as a colour map for Matplotlib, by default cividis."""
    return "cividis" if colours is None else ListedColormap(colours / 255.0)


def draw_three_maps(
    figure: Figure, maps: Float32Array, grid: MembraneGrid, label: str, colours: ColourTable | None
) -> Sequence[Axes]:
    """Show a map of each channel with a common scale. A value of 0 is unknown."""
    valid_mask = np.asarray((maps > 0.0).all(axis=2))
    values = np.where(valid_mask[..., None], maps, np.nan)
    low, high = np.percentile(maps[valid_mask], [0.5, 99.5]) if valid_mask.any() else (0.0, 1.0)
    # Means over pixels as small as print shows.
    fine = min(MAP_PX / maps.shape[1], 1.0)
    values = cv2.resize(values, None, fx=fine, fy=fine, interpolation=cv2.INTER_AREA)
    # A layout by the sizes of all labels would take as long as the drawing.
    figure.set_layout_engine(None)
    panels: list[Axes] = list(figure.subplots(1, 3, sharey=True, gridspec_kw=MAP_PLACES))
    for k, axes in enumerate(panels):
        image = axes.imshow(
            values[..., k],
            extent=grid_extent(grid),
            cmap=colour_map(colours),
            vmin=float(low),
            vmax=float(high),
        )
        axes.set_title(CHANNEL_KEYS[k], color=COLOURS[k])
        axes.set_xlabel("x (mm)")
    panels[0].set_ylabel("y (mm)")
    figure.colorbar(image, cax=figure.add_axes(SCALE_PLACE), label=label)
    return panels
