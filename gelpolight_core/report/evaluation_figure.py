"""The errors of an evaluation as a figure in the manner of the paper's Fig. 13."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.drawing_thread import Axes, Figure
from gelpolight_core.measurement.evaluation import DIRECTIONS, Evaluation, errors_by_dimension
from gelpolight_core.measurement.press import Press
from gelpolight_core.quantity import PAPER_PERCENT

COLOURS = {"cylinder": "#0072b2", "cuboid": "#d55e00", "ball": "#009e73"}
"""Colours of Okabe and Ito, which colour-blind readers can distinguish."""
BAR_WIDTH = 0.26
HEIGHT = 0.4
"""Of the figure, over its width."""


def paint_evaluation(figure: Figure, evaluation: Evaluation) -> None:
    """Paint the error by nominal dimension, for each shape and direction (the paper's Fig. 13).

    Bars are mean absolute errors, whiskers one standard deviation of the presses, dots the
    presses; the dashed line is the paper's mean.

    Parameters
    ----------
    figure : Figure
        Empty; its height follows from its width.
    evaluation : Evaluation
        From :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.
    """
    figure.set_figheight(figure.get_figwidth() * HEIGHT)
    panels = figure.subplots(1, 2)
    for axes, direction in zip(panels, DIRECTIONS, strict=True):
        _panel(axes, evaluation.series(direction), direction)
    handles, labels = panels[0].get_legend_handles_labels()
    note = "bars: mean, whiskers: one standard deviation, dots: presses"
    if evaluation.failed:
        note += f"; {evaluation.failure}"
    figure.supxlabel(note, fontsize="medium", color="0.35")
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)


def _panel(axes: Axes, results: Sequence[Press], direction: str) -> None:
    """Draw one direction: bars by nominal dimension, one colour for each shape."""
    dimensions, bars = errors_by_dimension(results, direction)
    shapes = [shape for shape in COLOURS if any(r.truth.shape == shape for r in results)]
    top = PAPER_PERCENT[direction]
    for (shape, x), errors in bars.items():
        offset = (shapes.index(shape) - (len(shapes) - 1) / 2.0) * BAR_WIDTH
        _bar(axes, x + offset, errors, COLOURS[shape])
        top = max(top, float(errors.max()))
    for shape in shapes:
        axes.bar(0.0, 0.0, color=COLOURS[shape], alpha=0.55, label=shape)
    axes.axhline(
        PAPER_PERCENT[direction],
        color="0.25",
        linestyle="--",
        linewidth=1.0,
        label="the paper's mean (5 % / 8 %)",
    )
    axes.set_ylim(0.0, 1.15 * top)
    axes.set_xlim(-0.6, len(dimensions) - 0.4)
    axes.set_xticks(range(len(dimensions)), [f"{dimension:g}" for dimension in dimensions])
    axes.set_xlabel("diameter or side (mm)" if direction == "planar" else "indentation depth (mm)")
    axes.set_ylabel("absolute error (%)")
    title = "planar direction" if direction == "planar" else "depth direction"
    axes.set_title(title, fontsize="medium")
    axes.spines[["top", "right"]].set_visible(False)


def _bar(axes: Axes, x: float, errors: NDArray[np.float64], colour: str) -> None:
    """Draw the mean, its spread and the presses of one dimension and shape."""
    mean = float(errors.mean())
    axes.bar(x, mean, width=0.9 * BAR_WIDTH, color=colour, alpha=0.55)
    if errors.size > 1:
        spread = float(errors.std(ddof=1))
        axes.errorbar(
            x,
            mean,
            yerr=[[min(spread, mean)], [spread]],
            color="0.15",
            capsize=3,
            linewidth=1.2,
        )
    jitter = np.linspace(-0.25, 0.25, errors.size) * BAR_WIDTH if errors.size > 1 else [0.0]
    axes.plot(x + np.asarray(jitter), errors, ".", color=colour, markersize=5)
