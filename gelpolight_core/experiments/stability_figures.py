"""The figures of the stability report: errors with their limits, and the tornado chart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from gelpolight_core.experiments.log_axes import number_logarithmically
from gelpolight_core.experiments.sensitivity import Sensitivity
from gelpolight_core.experiments.stability import CaseResult, Outcome
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import draw
from gelpolight_core.translation import tr

COLOURS = {Outcome.PASSED: "#1b6e3a", Outcome.REFUSED: "#8a5200", Outcome.FAILED: "#b3211d"}
MARKERS = {Outcome.PASSED: "o", Outcome.REFUSED: "D", Outcome.FAILED: "X"}
LEAST_UM = 1e-4
TORNADO_TICKS = (-10.0, -1.0, -0.1, 0.0, 0.1, 1.0, 10.0)
ROW_MM = 4.6
FEWEST_MM = 26.0
LOW, HIGH = "#0072b2", "#d55e00"


def draw_outcomes(results: Sequence[CaseResult]) -> Drawing:
    """Show the error of each case with its limit."""
    shown = [r for r in results if r.seen is not None and r.seen.error_um is not None]

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        for row, result in enumerate(shown):
            seen = result.seen
            assert seen is not None and seen.error_um is not None
            colour = COLOURS[result.outcome]
            error = max(seen.error_um, LEAST_UM)
            axes.plot(error, row, MARKERS[result.outcome], color=colour, markersize=4)
            if seen.bound_um is not None:
                axes.plot(seen.bound_um, row, "|", color="0.3", markersize=8)
        axes.set_yticks(range(len(shown)), [r.case.name for r in shown], fontsize=6)
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xscale("log")
        number_logarithmically(axes.xaxis)
        axes.grid(axis="x", color="0.9")
        axes.set_xlabel(tr("error of the depth, RMS (um)"))

    caption = tr(
        "Error of the depth; the bar is the largest error that passes. Circle: "
        "passed, diamond: wrong, but reported by the map, cross: failed"
    )
    return draw(caption, max(ROW_MM * len(shown) + 12.0, FEWEST_MM), paint)


def draw_tornado(found: Sequence[Sensitivity]) -> Drawing:
    """Show the effect of each parameter's standard uncertainty on the height of the plateau."""

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.arange(len(found))
        axes.barh(rows, [s.low_percent for s in found], color=LOW, label=tr("parameter too low"))
        axes.barh(
            rows,
            [s.high_percent for s in found],
            color=HIGH,
            height=0.5,
            label=tr("parameter too high"),
        )
        labels = [f"{s.parameter.label} ({s.parameter.stated})" for s in found]
        axes.set_yticks(rows, labels, fontsize=6.5)
        axes.invert_yaxis()
        axes.axvline(0.0, color="0.3", lw=0.7)
        axes.grid(axis="x", color="0.9")
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xticks(TORNADO_TICKS, [f"{tick:g}" for tick in TORNADO_TICKS])
        axes.set_xticks([], minor=True)
        axes.set_xlabel(tr("change of a cylinder's height (%)"))
        axes.legend(loc="lower right")

    caption = tr(
        "Effect of one standard uncertainty of each calibration parameter alone "
        "on the height of a cylinder of 1 mm; linear up to 0.1 %, logarithmic "
        "above"
    )
    return draw(caption, ROW_MM * len(found) + 16.0, paint)
