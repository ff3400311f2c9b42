"""The one cause of a calibration's poor figures, and where or how it is mended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.calibration.ball_stage import BALLS, REFLECTANCE
from gelpolight_core.calibration.recipe import Results
from gelpolight_core.causes import best_cause
from gelpolight_core.finding import QualityTable, joined_tables, worst_of

SET_UP = "setup"
MENDED_IN = {
    "ball_radius": BALLS.key,
    "press_radius_percent": BALLS.key,
    "membrane": "radiance",
    "focus": "lens",
    "background_light_percent": "background",
    "background_place_percent": "background",
}
"""The step where a cause is mended; a stated number is mended in the set-up."""


@dataclass(frozen=True, slots=True)
class Mend:
    """What to do about poor figures.

    Attributes
    ----------
    text : str
        The cause with its remedy, without a full stop.
    step : str
        Key of the step or stage where it is mended.
    ball : str
        File name of the ball press whose diameter is wrong; empty for any other cause.
    diameter_mm : float
        The diameter that fits it, to two digits.
    """

    text: str
    step: str
    ball: str = ""
    diameter_mm: float = 0.0


def mend_of(quality: Mapping[str, QualityTable], results: Results) -> Mend | None:
    """Return what mends the most; None if all figures pass.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        Of every stage.
    results : Results
        Of every stage.
    """
    worst = worst_of(joined_tables(quality.values()).figures)
    if worst is None:
        return None
    cause = best_cause(quality)
    if cause is None:
        stage = next(key for key, table in quality.items() if worst in table.figures)
        return Mend(worst.sentence.rstrip("."), stage)
    found, step = results.get(REFLECTANCE), MENDED_IN.get(cause.key, SET_UP)
    if cause.key == "press_radius_percent" and found is not None:
        odd = max(found.table.agreements, key=lambda one: one.radius_off_percent)
        return Mend(cause.remedy, step, Path(odd.name).name, float(f"{2.0 * odd.radius_mm:.2g}"))
    return Mend(cause.remedy, step)
