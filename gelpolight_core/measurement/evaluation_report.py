"""The evaluation as text, CSV, JSON and a figure in the manner of the paper's Fig. 13."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator, Sequence
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gelpolight_core.drawing_thread import in_drawing_thread
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.io.table import csv_text
from gelpolight_core.measurement.evaluation import (
    ALL,
    DIRECTIONS,
    PAPER_PERCENT,
    Evaluation,
    Group,
    errors_by_dimension,
    region_kinds,
)
from gelpolight_core.measurement.press import Press
from gelpolight_core.translation import tr

COLOURS = {"cylinder": "#0072b2", "cuboid": "#d55e00", "ball": "#009e73"}
"""Colours of Okabe and Ito, which colour-blind readers can distinguish."""
BAR_WIDTH = 0.26


def evaluation_table(evaluation: Evaluation) -> str:
    """Return the evaluation as lines of text: every press, then every group.

    Parameters
    ----------
    evaluation : Evaluation
        From :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.
    """
    lines = list(_press_lines(evaluation))
    head = f"{'':44}{'n':>4}{'mean |e|':>10}{'mean':>9}{'sd':>8}{'lowest':>9}{'highest':>9}  (%)"
    lines += ["", head]
    lines += [_group_line(group) for group in evaluation.groups]
    lines += [
        tr("The paper: about {planar:.0f} % planar, {depth:.0f} % depth (random regions)").format(
            **PAPER_PERCENT
        )
    ]
    for gauge in evaluation.repeatability:
        lines.append(
            tr(
                "Repeatability, {direction}: {within} um within a region, {between} um between"
            ).format(
                direction=gauge.direction,
                within=_number(1e3 * gauge.within_region_mm, 1),
                between=_number(1e3 * gauge.between_regions_mm, 1),
            )
        )
    if evaluation.failed:
        lines.append(evaluation.failure)
    if evaluation.skipped:
        lines.append(
            tr("{count} skipped because this shape cannot be measured: {files}").format(
                count=len(evaluation.skipped), files=", ".join(evaluation.skipped)
            )
        )
    return "\n".join(lines)


def evaluation_json(evaluation: Evaluation) -> dict[str, Any]:
    """Return the evaluation as plain values; figures that do not exist are None.

    Parameters
    ----------
    evaluation : Evaluation
        From :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.
    """
    return {
        "paper_percent": dict(PAPER_PERCENT),
        "overall": {d: evaluation.overall(d).as_json("percent") for d in DIRECTIONS},
        "groups": [
            {
                "direction": group.direction,
                "shape": group.shape,
                "dimension_mm": group.dimension_mm,
                "regions": group.regions,
                **group.statistic.as_json("percent"),
            }
            for group in evaluation.groups
        ],
        "repeatability": [
            {
                "direction": gauge.direction,
                "within_region_sd_mm": _finite(gauge.within_region_mm),
                "between_regions_sd_mm": _finite(gauge.between_regions_mm),
            }
            for gauge in evaluation.repeatability
        ],
        "presses": [press.as_row() for press in evaluation.results],
        "failed": len(evaluation.failed),
        "skipped": list(evaluation.skipped),
    }


def evaluation_figure(evaluation: Evaluation) -> Figure:
    """Return error by nominal dimension, for each shape and direction (the paper's Fig. 13).

    Bars are mean absolute errors, whiskers one standard deviation of the presses, dots the
    presses; the dashed line is the paper's mean. One row of panels for each series of regions.

    Parameters
    ----------
    evaluation : Evaluation
        From :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.
    """
    figure = Figure(figsize=(11.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    paint_evaluation(figure, evaluation)
    return figure


def paint_evaluation(figure: Figure, evaluation: Evaluation) -> None:
    """Paint :func:`evaluation_figure` on an empty figure, whose height follows from its width."""
    kinds = region_kinds(evaluation.results)
    series = [name for name in kinds if name != ALL] or [ALL]
    figure.set_figheight(figure.get_figwidth() * (0.06 + 0.34 * len(series)))
    panels = figure.subplots(len(series), 2, squeeze=False)
    for row, name in zip(panels, series, strict=True):
        for axes, direction in zip(row, DIRECTIONS, strict=True):
            _panel(axes, evaluation.series(direction, kinds[name]), direction, name)
    handles, labels = panels[0][0].get_legend_handles_labels()
    note = tr("bars: mean, whiskers: one standard deviation, dots: presses")
    if evaluation.failed:
        note += f"; {evaluation.failure}"
    figure.supxlabel(note, fontsize="medium", color="0.35")
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)


@in_drawing_thread
def write_evaluation(evaluation: Evaluation, folder: Path) -> tuple[Path, ...]:
    """Write ``evaluation.txt``, ``.csv``, ``.json`` and ``.png``; return their paths.

    Parameters
    ----------
    evaluation : Evaluation
        From :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.
    folder : Path
        Where to; it must exist.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    rows = [press.as_row() for press in evaluation.results]
    image = io.BytesIO()
    evaluation_figure(evaluation).savefig(image, format="png", dpi=150)
    contents = {
        "evaluation.txt": (evaluation_table(evaluation) + "\n").encode(),
        "evaluation.csv": csv_text(list(rows[0]), (row.values() for row in rows)).encode(),
        "evaluation.json": (
            json.dumps(evaluation_json(evaluation), indent=2, allow_nan=False) + "\n"
        ).encode(),
        "evaluation.png": image.getvalue(),
    }
    for name, content in contents.items():
        write_atomically(folder / name, methodcaller("write", content))
    return tuple(folder / name for name in contents)


def _press_lines(evaluation: Evaluation) -> Iterator[str]:
    """Yield the heads of the columns, then the presses."""
    width = max(4, *(len(press.file) for press in evaluation.results))
    yield (
        f"{'file':{width}}  {'shape':8}{'size':>8}{'measured':>10}{'error':>9}"
        f"{'height':>9}{'measured':>10}{'error':>9}  verdict"
    )
    for press in evaluation.results:
        truth, measured = press.truth, press.measurement
        line = f"{press.file:{width}}  {truth.shape:8}"
        if measured is None:
            yield f"{line}  " + tr("not measured: {reason}").format(reason=press.outcome)
            continue
        for true_mm, value_mm, error, form in (
            (truth.size_mm, measured.size_mm, press.error_percent("planar"), "8.2f"),
            (truth.height_mm, measured.height_mm, press.error_percent("depth"), "9.2f"),
        ):
            line += f"{true_mm:{form}}{value_mm:10.3f}{error:+8.2f}%"
        yield f"{line}  {measured.verdict}" + (f": {measured.reason}" if measured.reason else "")


def _group_line(group: Group) -> str:
    size = "" if group.dimension_mm is None else f"{group.dimension_mm:g} mm"
    s = group.statistic
    return (
        f"{group.regions:16}{group.direction:8}{group.shape:10}{size:>10}{s.count:>4}"
        f"{_number(s.mean_absolute):>10}{_number(s.mean, sign=True):>9}"
        f"{_number(s.sd):>8}{_number(s.lowest, sign=True):>9}"
        f"{_number(s.highest, sign=True):>9}"
    )


def _number(value: float, digits: int = 2, *, sign: bool = False) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:+.{digits}f}" if sign else f"{value:.{digits}f}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _panel(axes: Axes, results: Sequence[Press], direction: str, regions: str) -> None:
    """Draw one direction of one series: bars by nominal dimension, one colour for each shape."""
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
        label=tr("the paper's mean (5 % / 8 %)"),
    )
    axes.set_ylim(0.0, 1.15 * top)
    axes.set_xlim(-0.6, len(dimensions) - 0.4)
    axes.set_xticks(range(len(dimensions)), [f"{dimension:g}" for dimension in dimensions])
    axes.set_xlabel(
        tr("diameter or side (mm)") if direction == "planar" else tr("indentation depth (mm)")
    )
    axes.set_ylabel(tr("absolute error (%)"))
    title = tr("planar direction") if direction == "planar" else tr("depth direction")
    axes.set_title(title if regions == ALL else f"{title}, {regions}", fontsize="medium")
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
