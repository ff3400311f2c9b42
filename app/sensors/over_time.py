"""How good a sensor was over time: its validations and calibrations, with their tolerances."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from app.services.preferences import Limits
from app.widgets.time_chart import DEPTH, PLANE, Series
from app.workspace.entries import Entry
from gelpolight_core.finding import joined_tables
from gelpolight_core.io.reading import parse_time
from gelpolight_core.validation import Validation

BALLS = ("#3d7a1f", "#9bd070")
"""Colour of ball presses, in the light and the dark theme."""
OF_BALLS = "ball_height_error_percent", "held_out_diameter_percent"
"""Error of the ball presses of an open and of a closed sensor's calibration."""

Points = dict[datetime, float]


def checks_over_time(entries: Iterable[Entry], limits: Limits) -> tuple[Series, ...]:
    """Return the errors of a sensor's validations, and those of the balls of its calibrations.

    Parameters
    ----------
    entries : iterable of Entry
        All calibrations of one sensor.
    limits : Limits
        Tolerances of a validation. That of the balls is in the calibration.
    """
    sizes, heights, balls = Points(), Points(), Points()
    balls_limit = 0.0
    for entry in entries:
        if entry.validation is not None:
            _add_validation(entry.validation, sizes, heights)
        quality = {} if entry.summary is None else entry.summary.quality
        for figure in joined_tables(quality.values()).figures:
            if figure.key in OF_BALLS and entry.created is not None:
                balls[entry.created] = figure.value
                balls_limit = figure.warn_limit or 0.0
    all_series = (
        _series("Validation: size", sizes, limits.size_percent, PLANE, "o"),
        _series("Validation: height", heights, limits.height_percent, DEPTH, "t"),
        _series("Calibration: balls", balls, balls_limit, BALLS, "s"),
    )
    return tuple(series for series in all_series if series.values)


def _add_validation(validation: Validation, sizes: Points, heights: Points) -> None:
    """Add the error of the height, and the largest one of a size."""
    when = parse_time(validation.when)
    errors = {c.name: c.error_percent for c in validation.comparisons}
    known = {name: error for name, error in errors.items() if error is not None}
    if when is None:
        return
    if "height" in known:
        heights[when] = known.pop("height")
    if known:
        sizes[when] = max(known.values(), key=abs)


def _series(name: str, points: Points, limit: float, colours: tuple[str, str], sign: str) -> Series:
    times = sorted(points)
    seconds = [time.timestamp() for time in times]
    return Series(name, seconds, [points[time] for time in times], limit, colours, sign)
