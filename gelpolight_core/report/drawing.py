"""Common parts of all drawings of the report: sizes, colours, images and maps in millimetres."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gelpolight_core.channels import channel_name
from gelpolight_core.drawing_thread import in_drawing_thread
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.report.document import Drawing

Array = NDArray[np.float64]
Map = NDArray[np.float32]
FULL_MM = 180.0
"""Width between the margins of an A4 page."""
DPI = 200
COLOURS = ("#c62828", "#2e7d32", "#1f4fbf")
MARKERS = ("o", "s", "^")
"""A marker shape for each channel, for colour-blind readers and grey printers."""
ACCENT = "#e69f00"
MAP_COLOURS = "cividis"
_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.4",
    "axes.linewidth": 0.7,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    # File names may contain dollar signs.
    "text.parse_math": False,
}


@in_drawing_thread
def draw(
    caption: str, height_mm: float, paint: Callable[[Figure], None], *, width_mm: float = FULL_MM
) -> Drawing:
    """Return the drawing made by `paint` on an empty figure of the given size."""
    with rc_context(_STYLE):
        figure = Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout="constrained")
        FigureCanvasAgg(figure)
        paint(figure)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=DPI)
    return Drawing(caption, stream.getvalue(), width_mm, height_mm)


def round_to_one_digit(value: float) -> float:
    """Return a positive value rounded to one significant digit, for magnifications."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(round(value / power), 1) * power


def show_image(axes: Axes, rgb: Map, *, width_px: int = 900, extent: Sequence[float] = ()) -> None:
    """Show a linear image with the screen's gamma, in its own pixel coordinates or `extent`."""
    rows, columns = rgb.shape[:2]
    shown = rgb
    if columns > width_px:
        size = (width_px, max(round(rows * width_px / columns), 1))
        shown = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.float32)
    full = tuple(extent) or (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(
        np.clip(shown, 0.0, 1.0) ** (1 / 2.2),
        extent=(full[0], full[1], full[2], full[3]),
        interpolation="antialiased",
    )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)


def grid_extent(grid: MembraneGrid) -> tuple[float, float, float, float]:
    """Return a map's edges in mm for matplotlib; y increases downwards, as in the image."""
    half = 0.5 * grid.pitch_mm
    x, y = grid.x_mm, grid.y_mm
    return float(x[0] - half), float(x[-1] + half), float(y[-1] + half), float(y[0] - half)


def three_maps(
    figure: Figure, maps: Map, known: NDArray[np.bool_], grid: MembraneGrid, label: str
) -> Sequence[Axes]:
    """Show one map per channel with a common scale, robust against specks; return their axes."""
    shown = np.where(known[..., None], maps, np.nan)
    low, high = np.nanpercentile(shown, [0.5, 99.5]) if known.any() else (0.0, 1.0)
    step = max(maps.shape[1] // 420, 1)
    panels: list[Axes] = list(figure.subplots(1, 3, sharey=True))
    for k, axes in enumerate(panels):
        image = axes.imshow(
            shown[::step, ::step, k],
            extent=grid_extent(grid),
            cmap=MAP_COLOURS,
            vmin=float(low),
            vmax=float(high),
        )
        axes.set_title(channel_name(k), color=COLOURS[k])
        axes.set_xlabel("x (mm)")
    panels[0].set_ylabel("y (mm)")
    figure.colorbar(image, ax=panels, label=label, shrink=0.8, pad=0.01)
    return panels
