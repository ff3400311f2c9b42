"""Check of scale and ball diameters by values of other sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gelpolight_core.base.errors import Remedy
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid
from gelpolight_core.stages.balls.indentation_checks import LARGEST_OF_BALL

from .preset import Preset, presets
from .slope_calibration import InPlaceResult

COLOUR_OVER_WIDTH = (2.14, 1.64, 2.69, 0.68)
"""Colour per slope over the contact's width in ball diameters: two GelSight Mini, a DIGIT and a
home-made sensor with markers. A diameter that is stated too large makes slope and width too small,
so that the number changes by the square of the mistake."""
DOUBTFUL_SDS, IMPOSSIBLE_SDS = 2.0, 4.0
"""Limits of a mistake, in standard deviations of the sensors that are known."""
SIZE_LIMITS = 8.0, 25.0
"""Percent between the slopes of balls of two sizes: the limits of the height of a press."""


def preset_of(grid: WorkingGrid) -> Preset | None:
    """Return the preset whose nominal scale is stated, or None."""
    size = grid.image
    for preset in presets().values():
        width, height = preset.image_px
        nominal = preset.mm_per_px * width / size.width
        same_shape = size.width * height == size.height * width
        # A preset's scale is stated with three digits.
        if same_shape and abs(grid.mm_per_px / nominal - 1.0) < 1e-3:
            return preset
    return None


def judge_kind(result: InPlaceResult) -> tuple[Finding, ...]:
    """Judge scale and ball diameters by the contacts, the colours, and the balls among themselves.

    Parameters
    ----------
    result : InPlaceResult
        With its presses.
    """
    widths = np.array([press.width for press in result.presses])
    colours = np.array([press.held_out.colour_per_slope for press in result.presses])
    wide = judge(
        "contact_over_ball",
        "Width of the contacts over that of the balls, median",
        float(np.median(widths)),
        fail=LARGEST_OF_BALL,
        remedy=Remedy.CHECK_SIZES,
    )
    preset = preset_of(result.model.grid)
    if preset is not None and preset.colour_per_slope:
        mistake = float(np.median(colours)) / preset.colour_per_slope
        sd = preset.colour_per_slope_sd / preset.colour_per_slope
    else:
        logs = np.log(COLOUR_OVER_WIDTH)
        mistake = math.exp(0.5 * float(np.median(np.log(colours / widths)) - logs.mean()))
        sd = 0.5 * float(logs.std(ddof=1))
    factor = max(mistake, 1.0 / mistake)
    size = "large" if mistake > 1.0 else "small"
    remedy = f"Balls look {factor:.1f} times too {size} for the scale, compared with other sensors"
    return (
        wide,
        judge(
            "ball_size_factor",
            "Size of the balls against what colours of other sensors suggest, factor",
            factor,
            warn=math.exp(DOUBTFUL_SDS * sd),
            fail=math.exp(IMPOSSIBLE_SDS * sd),
            remedy=f"{remedy}. {Remedy.CHECK_SIZES.format()}",
        ),
        *_judge_sizes(result.sizes),
    )


def _judge_sizes(sizes: Sequence[tuple[float, float, float]]) -> tuple[Finding, ...]:
    """Judge balls of several sizes by each other."""
    if not sizes:
        return ()
    # Fits with fewer presses have smaller slopes, alike for all sizes.
    common = math.exp(np.mean([math.log(max(ratio, 1e-3)) for _, ratio, _ in sizes]))
    # Two sizes differ alike from what they have in common: the better known one is judged.
    radius, ratio, sd = max(
        sizes, key=lambda size: abs(math.log(max(size[1], 1e-3) / common)) / max(size[2], 1e-6)
    )
    other = ", ".join([f"{2.0 * r:.3g}" for r, *_ in sizes if r != radius])
    diameter = 2.0 * radius
    remedy = f"The balls of {diameter:.3g} mm contradict those of {other} mm: check their diameters"
    doubtful, impossible = (limit + DOUBTFUL_SDS * 100.0 * sd for limit in SIZE_LIMITS)
    return (
        judge(
            "ball_sizes_percent",
            "Slopes of balls of one size by those of the others, largest difference",
            100.0 * abs(ratio / common - 1.0),
            "%",
            warn=doubtful,
            fail=impossible,
            remedy=remedy,
        ),
    )
