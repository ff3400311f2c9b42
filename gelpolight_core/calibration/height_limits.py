"""Limits of a calibration's height errors, from the tolerance of heights that measurements need.

A measurement decides nothing where its expanded uncertainty is as large as the tolerance: a
calibration fails there, and warns from half of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from gelpolight_core.base.compared_quantity import COVERAGE, PAPER_PERCENT
from gelpolight_core.base.finding import Finding, QualityTable, judge

TOLERANCE_PERCENT = PAPER_PERCENT["depth"]
"""Of heights, by default."""
FAIL_PERCENT = TOLERANCE_PERCENT / COVERAGE
"""Errors of heights, of a press 1 mm deep, and their standard deviations."""
WARN_PERCENT = 0.5 * FAIL_PERCENT
WORTH = ("ball_height_error_percent", "depth_sd_percent", "joint_direction_percent")
"""Figures that say what the heights of a calibration will be worth."""


def judged_for(
    tables: Mapping[str, QualityTable], tolerance_percent: float
) -> dict[str, QualityTable]:
    """Return tables in which what heights will be worth is judged by a tolerance of heights."""
    scale = tolerance_percent / TOLERANCE_PERCENT

    def judged(f: Finding) -> Finding:
        limits = (WARN_PERCENT, FAIL_PERCENT)
        if f.key not in WORTH or (f.warn_limit, f.fail_limit) == (None, None):
            return f
        warn, fail = (
            None if limit is None else scale * usual
            for limit, usual in zip((f.warn_limit, f.fail_limit), limits, strict=True)
        )
        again = judge(f.key, f.text, f.value, f.unit, warn=warn, fail=fail, remedy=f.remedy)
        return replace(again, heights=f.heights)

    return {key: QualityTable(tuple(map(judged, t.figures))) for key, t in tables.items()}
