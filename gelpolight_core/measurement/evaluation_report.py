"""The evaluation as text, CSV, JSON and a figure in the manner of the paper's Fig. 13."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
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
from gelpolight_core.measurement.evaluation import (
    ALL,
    DIRECTIONS,
    PAPER_PERCENT,
    Evaluation,
    Group,
    PressResult,
    Statistic,
    dimension_mm,
    region_kinds,
)
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
    lines = [_press_head(evaluation), *(_press_line(evaluation, r) for r in evaluation.results)]
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
        "overall": {d: _statistic_json(evaluation.overall(d)) for d in DIRECTIONS},
        "groups": [
            {
                "direction": group.direction,
                "shape": group.shape,
                "dimension_mm": group.dimension_mm,
                "regions": group.regions,
                **_statistic_json(group.statistic),
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
        "presses": [_press_values(result) for result in evaluation.results],
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
    image = io.BytesIO()
    evaluation_figure(evaluation).savefig(image, format="png", dpi=150)
    contents = {
        "evaluation.txt": (evaluation_table(evaluation) + "\n").encode(),
        "evaluation.csv": _csv_text(evaluation).encode(),
        "evaluation.json": (
            json.dumps(evaluation_json(evaluation), indent=2, allow_nan=False) + "\n"
        ).encode(),
        "evaluation.png": image.getvalue(),
    }
    for name, content in contents.items():
        write_atomically(folder / name, methodcaller("write", content))
    return tuple(folder / name for name in contents)


def _press_head(evaluation: Evaluation) -> str:
    width = _name_width(evaluation)
    return (
        f"{'file':{width}}  {'shape':8}{'size':>8}{'measured':>10}{'error':>9}"
        f"{'height':>9}{'measured':>10}{'error':>9}  verdict"
    )


def _press_line(evaluation: Evaluation, result: PressResult) -> str:
    truth, measured = result.press.truth, result.measurement
    start = f"{result.press.file:{_name_width(evaluation)}}  {truth.shape:8}"
    if measured is None:
        return f"{start}  " + tr("not measured: {reason}").format(reason=result.failure)
    verdict = measured.verdict + (f": {measured.reason}" if measured.reason else "")
    return (
        f"{start}{truth.size_mm:8.2f}{measured.size_mm:10.3f}{result.planar_percent:+8.2f}%"
        f"{truth.height_mm:9.2f}{measured.height_mm:10.3f}{result.depth_percent:+8.2f}%  {verdict}"
    )


def _name_width(evaluation: Evaluation) -> int:
    return max(4, *(len(result.press.file) for result in evaluation.results))


def _group_line(group: Group) -> str:
    size = "" if group.dimension_mm is None else f"{group.dimension_mm:g} mm"
    s = group.statistic
    return (
        f"{group.regions:16}{group.direction:8}{group.shape:10}{size:>10}{s.count:>4}"
        f"{_number(s.mean_absolute_percent):>10}{_number(s.mean_percent, sign=True):>9}"
        f"{_number(s.sd_percent):>8}{_number(s.lowest_percent, sign=True):>9}"
        f"{_number(s.highest_percent, sign=True):>9}"
    )


def _number(value: float, digits: int = 2, *, sign: bool = False) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:+.{digits}f}" if sign else f"{value:.{digits}f}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _statistic_json(statistic: Statistic) -> dict[str, Any]:
    return {name: _finite(value) for name, value in asdict(statistic).items()}


def _press_values(result: PressResult) -> dict[str, Any]:
    truth, measured = result.press.truth, result.measurement
    return {
        "file": result.press.file,
        "shape": truth.shape,
        "region": result.press.region,
        "repeat": result.press.repeat,
        "true_size_mm": truth.size_mm,
        "size_mm": measured.size_mm if measured else None,
        "size_sd_mm": measured.size_sd_mm if measured else None,
        "planar_error_percent": _finite(result.planar_percent),
        "true_height_mm": truth.height_mm,
        "height_mm": measured.height_mm if measured else None,
        "height_sd_mm": measured.sd["height_mm"] if measured else None,
        "depth_error_percent": _finite(result.depth_percent),
        "verdict": measured.verdict if measured else "not measured",
        "reason": measured.reason if measured else result.failure,
    }


def _csv_text(evaluation: Evaluation) -> str:
    text = io.StringIO()
    rows = [_press_values(result) for result in evaluation.results]
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _panel(axes: Axes, results: Sequence[PressResult], direction: str, regions: str) -> None:
    """Draw one direction of one series: bars by nominal dimension, one colour for each shape."""
    dimensions = sorted({dimension_mm(r, direction) for r in results})
    shapes = [shape for shape in COLOURS if any(r.press.truth.shape == shape for r in results)]
    top = PAPER_PERCENT[direction]
    for k, shape in enumerate(shapes):
        offset = (k - (len(shapes) - 1) / 2.0) * BAR_WIDTH
        for x, dimension in enumerate(dimensions):
            errors = np.array(
                [
                    abs(r.error_percent(direction))
                    for r in results
                    if r.press.truth.shape == shape and dimension_mm(r, direction) == dimension
                ]
            )
            errors = errors[np.isfinite(errors)]
            if errors.size:
                _bar(axes, x + offset, errors, COLOURS[shape])
                top = max(top, float(errors.max()))
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
