"""The report of an evaluation (the paper's Fig. 13, the gauge, every press) and all its files."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.atomic_write import write_files
from gelpolight_core.base.compared_quantity import PAPER_PERCENT, value_text
from gelpolight_core.base.csv_table import csv_from_dicts
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.calibration.recipe import Facts
from gelpolight_core.measurement.statistics import finite_or_none, too_few_repeats
from gelpolight_core.output.drawing_thread import Axes, Figure
from gelpolight_core.output.report.document import (
    Report,
    ReportSection,
    TextTable,
    ValidationSummary,
    make_text_table,
    number_text,
    text_lines,
)
from gelpolight_core.output.report.drawing_tools import drawing, png
from gelpolight_core.output.report.facts import head_facts
from gelpolight_core.output.report.report_pdf_file import report_pdf
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.validation import WORDS

from .characteristics import Characteristic, characteristics
from .evaluation import DIRECTIONS, Evaluation, by_object, errors_by_dimension, evaluation_errors
from .gauge_study import GaugeRow, gauge_figures, gauge_rows
from .reference_press import ReferencePress

COLOURS = {"cylinder": "#0072b2", "cuboid": "#d55e00", "ball": "#009e73"}
"""Colours of Okabe and Ito, which colour-blind readers can distinguish."""
BAR_WIDTH = 0.26
HEIGHT = 0.4
"""Of the figure, over its width."""


def evaluation_document(
    evaluation: Evaluation,
    *,
    facts: Facts = (),
) -> Report:
    """Return the report of an evaluation.

    Parameters
    ----------
    evaluation : Evaluation
        Presses compared with their truth.
    facts : tuple of (label, value), optional
        Sensor, calibration and other facts for the head of the report.
    """
    errors = evaluation_errors(evaluation)
    sections = [
        ReportSection(
            "errors",
            "Errors by size and height",
            (
                "As in the paper's Fig. 13: planar errors are errors of diameters and sides, "
                "depth errors are errors of heights"
            ),
            errors,
            drawings=(_draw_errors(evaluation),),
            listings=(_groups(evaluation),),
        )
    ]
    gauge = gauge_rows(evaluation)
    if gauge:
        sections.append(_gauge_section(gauge))
    sections.append(
        ReportSection(
            "characteristics",
            "Characteristics of the sensor",
            (
                "In the terms of ISO 25178-600. U is the expanded uncertainty (k = 2); a surface "
                "that is finer than the lateral period limit has less than half its height"
            ),
            QualityTable(
                tuple(characteristic.finding for characteristic in _characteristics(evaluation))
            ),
        )
    )
    return Report(
        title="Evaluation on objects of characteristic size",
        verdict=errors.verdict,
        facts=facts,
        validation=ValidationSummary(evaluation_sentence(evaluation), errors.verdict),
        sections=tuple(sections),
        listings=(known_objects(evaluation, "Every press"),),
        data={"evaluation": evaluation_json(evaluation)},
    )


def validation_of(evaluation: Evaluation) -> ValidationSummary:
    """Return the validation of a calibration from an evaluation on presses of known size.

    Parameters
    ----------
    evaluation : Evaluation
        Made with the calibration.
    """
    errors = evaluation_errors(evaluation)
    nothing = len(evaluation.failed) == len(evaluation.results)
    verdict = Verdict.WARN if nothing else errors.verdict
    reasons = () if nothing else errors.remedies
    return ValidationSummary(
        f"{WORDS[verdict]}: {'; '.join((evaluation_sentence(evaluation), *reasons))}",
        verdict,
        known_objects(evaluation, "Objects of known size"),
        evaluation_json(evaluation),
    )


def _characteristics(evaluation: Evaluation) -> tuple[Characteristic, ...]:
    return characteristics(evaluation.results, evaluation.flat_um)


@drawing(70.0)
def _draw_errors(figure: Figure, evaluation: Evaluation) -> str:
    paint_evaluation(figure, evaluation)
    return (
        "Absolute errors: bars are means, whiskers one standard deviation, dots the presses; the "
        "dashed line is the mean reported in the paper"
    )


def paint_evaluation(figure: Figure, evaluation: Evaluation) -> None:
    """Paint the error by nominal dimension, for each shape and direction (the paper's Fig. 13).

    Bars are mean absolute errors, whiskers one standard deviation of the presses, dots the
    presses; the dashed line is the paper's mean.

    Parameters
    ----------
    figure : Figure
        Empty; its height follows from its width.
    evaluation : Evaluation
        From :func:`~gelpolight_core.lab.evaluation_run.evaluate_presses`.
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


def _panel(axes: Axes, results: Sequence[ReferencePress], direction: str) -> None:
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


def _groups(evaluation: Evaluation) -> TextTable:
    return make_text_table(
        "Errors in percent of the true length",
        evaluation.groups,
        ("direction", lambda group: group.direction),
        ("shape", lambda group: group.shape),
        ("mm", lambda g: "" if g.dimension_mm is None else f"{g.dimension_mm:g}"),
        ("n", lambda group: str(group.statistic.count)),
        ("mean |e|", lambda group: number_text(group.statistic.mean_absolute, ".2f")),
        ("mean", lambda group: number_text(group.statistic.mean, "+.2f")),
        ("sd", lambda group: number_text(group.statistic.sd, ".2f")),
        ("lowest", lambda group: number_text(group.statistic.lowest, "+.2f")),
        ("highest", lambda group: number_text(group.statistic.highest, "+.2f")),
    )


def _gauge_section(gauge: tuple[GaugeRow, ...]) -> ReportSection:
    table = make_text_table(
        "Object by object",
        [row for row in gauge if row.truth is not None],
        ("direction", lambda row: row.direction),
        ("shape", lambda row: row.shape),
        ("true (mm)", lambda row: f"{row.true_mm:g}"),
        ("n", lambda row: str(row.measured.count)),
        ("mean (mm)", lambda row: number_text(row.measured.mean, ".4f")),
        ("sd: repeatability", _repeatability),
    )
    intro = "Repeatability is the standard deviation of presses of the same object"
    title = "Repeatability of the gauge"
    return ReportSection("gauge", title, intro, gauge_figures(gauge), listings=(table,))


def known_objects(evaluation: Evaluation, title: str) -> TextTable:
    """Return every press with its true and measured lengths."""
    return make_text_table(
        title,
        evaluation.rows,
        ("image", lambda press: press["file"]),
        ("shape", lambda press: press["shape"]),
        ("size (mm)", lambda press: number_text(press["true_size_mm"], "g")),
        ("measured", lambda press: _measured(press, "size")),
        ("error", lambda press: number_text(press["planar_error_percent"], "+.2f", " %")),
        ("En", lambda press: number_text(press["planar_en"], ".2f")),
        ("height (mm)", lambda press: number_text(press["true_height_mm"], "g")),
        ("measured", lambda press: _measured(press, "height")),
        ("error", lambda press: number_text(press["depth_error_percent"], "+.2f", " %")),
        ("En", lambda press: number_text(press["depth_en"], ".2f")),
        ("verdict", lambda p: ": ".join(filter(None, (p["verdict"], p["reason"])))),
    )


def evaluation_sentence(evaluation: Evaluation) -> str:
    """Return the result of an evaluation as a sentence without a full stop."""
    count = len(evaluation.results)
    measured = count - len(evaluation.failed)
    if not measured:
        return f"None of {count} presses could be measured"
    summary = [f"{measured} of {count} presses were measured"]
    for direction, limit in zip(DIRECTIONS, evaluation.limits_percent, strict=True):
        error = evaluation.overall(direction).mean_absolute
        if math.isfinite(error):
            text = f"mean absolute error in the {direction} direction {error:.2f} %"
            summary.append(f"{text} (tolerance {limit:g} %)")
    return "; ".join(summary)


def _measured(press: dict[str, Any], length: str) -> str:
    value_mm = press[f"{length}_mm"]
    return "" if value_mm is None else value_text(value_mm, press[f"{length}_sd_mm"])


def _repeatability(row: GaugeRow) -> str:
    """Return the standard deviation of an object, or how many repeats it lacks."""
    return too_few_repeats(row.missing) or number_text(
        1e3 * row.repeatability_mm, ".1f", " \N{MICRO SIGN}m"
    )


def evaluation_table(evaluation: Evaluation) -> str:
    """Return the evaluation as lines of text: every press, then every group."""
    presses = known_objects(evaluation, "Every press")
    lines = [*text_lines(presses), "", *text_lines(_groups(evaluation)), ""]
    lines += [figure.sentence for figure in gauge_figures(gauge_rows(evaluation)).figures]
    lines += [characteristic.finding.stated for characteristic in _characteristics(evaluation)]
    lines.append(evaluation_sentence(evaluation))
    if evaluation.failed:
        lines.append(evaluation.failure)
    if evaluation.skipped:
        skipped = f"{len(evaluation.skipped)} skipped because this shape cannot be measured"
        lines.append(f"{skipped}: {', '.join(evaluation.skipped)}")
    return "\n".join(lines)


def evaluation_json(evaluation: Evaluation) -> dict[str, Any]:
    """Return the evaluation as plain values, None for figures that do not exist."""
    return {
        "paper_percent": dict(PAPER_PERCENT),
        "overall": {d: evaluation.overall(d).as_json("percent") for d in DIRECTIONS},
        "groups": [
            {
                "direction": group.direction,
                "shape": group.shape,
                "dimension_mm": group.dimension_mm,
                **group.statistic.as_json("percent"),
            }
            for group in evaluation.groups
        ],
        "tolerance_percent": dict(zip(DIRECTIONS, evaluation.limits_percent, strict=True)),
        "errors": [
            row | {"value": finite_or_none(row["value"])}
            for row in evaluation_errors(evaluation).as_rows()
        ],
        "repeatability": [
            {
                "direction": row.direction,
                "sd_mm": row.repeatability_mm,
                "missing": row.missing,
            }
            for row in gauge_rows(evaluation)
            if row.truth is None
        ],
        "characteristics": [
            characteristic.as_json() for characteristic in _characteristics(evaluation)
        ],
        "references": [
            truth.as_json() | {"findings": [finding.text for finding in truth.findings()]}
            for truth in by_object(evaluation.results)
        ],
        "presses": evaluation.rows,
        "failed": len(evaluation.failed),
        "skipped": list(evaluation.skipped),
    }


def write_evaluation_files(
    evaluation: Evaluation,
    folder: Path,
    *,
    calibration: Calibration | None = None,
) -> tuple[Path, ...]:
    """Write ``evaluation.txt``, ``.csv``, ``.json``, ``.png``, ``.pdf`` and a gauge CSV.

    Parameters
    ----------
    evaluation : Evaluation
        Presses compared with their truth.
    folder : Path
        Destination; it must exist.
    calibration : Calibration, optional
        Named in the report.

    Returns
    -------
    tuple of Path
        The files written; ``gauge.csv`` only if an object is pressed more than once.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    facts = () if calibration is None else head_facts(calibration)
    document = evaluation_document(evaluation, facts=facts)
    content = json.dumps(evaluation_json(evaluation), indent=2, allow_nan=False)
    contents = {
        "evaluation.txt": (evaluation_table(evaluation) + "\n").encode(),
        "evaluation.csv": csv_from_dicts(evaluation.rows).encode(),
        "evaluation.json": (content + "\n").encode(),
        "evaluation.png": png(lambda figure: paint_evaluation(figure, evaluation), 11.0, 11.0),
        "evaluation.pdf": report_pdf(document),
    }
    gauge = gauge_rows(evaluation)
    if gauge:
        contents["gauge.csv"] = csv_from_dicts(
            [_gauge_row(row, row.truth) for row in gauge if row.truth is not None]
        ).encode()
    return write_files(folder, contents)


def _gauge_row(row: GaugeRow, truth: ReferenceObject) -> dict[str, str | float | None]:
    """Return one object and direction as a line of the table."""
    return {
        "direction": row.direction,
        "shape": truth.shape,
        "size_mm": truth.size_mm,
        "height_mm": truth.height_mm,
        "n": row.measured.count,
        "mean_mm": row.measured.mean,
        "repeatability_sd_mm": row.repeatability_mm,
    }
