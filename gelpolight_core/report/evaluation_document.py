"""The evaluation as a document: the paper's Fig. 13, repeatability of the gauge, every press."""

from __future__ import annotations

import io
import math

from gelpolight_core.drawing_thread import in_drawing_thread
from gelpolight_core.measurement.evaluation import (
    ALL,
    DIRECTIONS,
    PAPER_PERCENT,
    Evaluation,
    PressResult,
    Repeatability,
)
from gelpolight_core.measurement.evaluation_report import evaluation_figure
from gelpolight_core.measurement.gauge import GaugeRow, gauge_rows
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.report.document import Drawing, Listing, Report, Section, Validation
from gelpolight_core.report.drawing import DPI, FULL_MM
from gelpolight_core.report.labels import label
from gelpolight_core.translation import tr

PLUS_MINUS = "\N{PLUS-MINUS SIGN}"
EM_DASH = "\N{EM DASH}"


def evaluation_document(
    evaluation: Evaluation,
    *,
    facts: tuple[tuple[str, str], ...] = (),
    limits_percent: tuple[float, float] = (PAPER_PERCENT["planar"], PAPER_PERCENT["depth"]),
) -> Report:
    """Return the report of an evaluation.

    Parameters
    ----------
    evaluation : Evaluation
        Presses compared with their truth.
    facts : tuple of (label, value), optional
        Sensor, calibration and other facts for the head of the report.
    limits_percent : (float, float), optional
        Largest mean absolute errors, planar and in depth, for it to pass.
    """
    limits = dict(zip(DIRECTIONS, limits_percent, strict=True))
    errors = QualityTable(
        tuple(f for direction in DIRECTIONS for f in _judged(evaluation, direction, limits))
    )
    sections = [
        Section(
            "errors",
            tr("Errors by size and height"),
            tr(
                "As in the paper's Fig. 13: planar errors are errors of diameters and sides, "
                "depth errors are errors of heights"
            ),
            errors,
            drawings=(_drawing(evaluation),),
            listings=(_groups(evaluation),),
        )
    ]
    gauge = gauge_rows(evaluation)
    if gauge:
        sections.append(_gauge_section(evaluation, gauge))
    return Report(
        title=tr("Evaluation on objects of known size"),
        verdict=errors.verdict,
        facts=facts,
        validation=Validation(_sentence(evaluation)),
        sections=tuple(sections),
        sources=_presses(evaluation),
    )


def _judged(evaluation: Evaluation, direction: str, limits: dict[str, float]) -> tuple[Figure, ...]:
    name = label(direction)
    if not evaluation.series(direction):
        return ()  # there is no press for this direction yet
    found = [
        judge(
            f"{direction}_mean",
            tr("Mean absolute error, {direction}").format(direction=name),
            evaluation.overall(direction).mean_absolute_percent,
            "%",
            fail=limits[direction],
            advice=tr("Calibrate again, or check the worst presses"),
        )
    ]
    for group in evaluation.groups:
        overall = group.shape == ALL and group.dimension_mm is None and group.regions != ALL
        mean = group.statistic.mean_absolute_percent
        if group.direction == direction and overall and math.isfinite(mean):
            found.append(
                judge(
                    f"{direction}_{group.regions.replace(' ', '_')}",
                    tr("Mean absolute error, {direction}, {regions}").format(
                        direction=name, regions=label(group.regions)
                    ),
                    mean,
                    "%",
                )
            )
    return tuple(found)


@in_drawing_thread
def _drawing(evaluation: Evaluation) -> Drawing:
    figure = evaluation_figure(evaluation)
    width, height = figure.get_size_inches()
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI * FULL_MM / 25.4 / width)
    caption = tr(
        "Absolute errors: bars are means, whiskers one standard deviation, dots the presses; the "
        "dashed line is the mean reported in the paper"
    )
    return Drawing(caption, stream.getvalue(), FULL_MM, FULL_MM * float(height / width))


def _groups(evaluation: Evaluation) -> Listing:
    rows = tuple(
        (
            label(g.regions),
            label(g.direction),
            label(g.shape),
            "" if g.dimension_mm is None else f"{g.dimension_mm:g}",
            str(g.statistic.count),
            _percent(g.statistic.mean_absolute_percent),
            _percent(g.statistic.mean_percent, sign=True),
            _percent(g.statistic.sd_percent),
            _percent(g.statistic.lowest_percent, sign=True),
            _percent(g.statistic.highest_percent, sign=True),
        )
        for g in evaluation.groups
    )
    heads = (
        tr("regions"),
        tr("direction"),
        tr("shape"),
        tr("mm"),
        tr("n"),
        tr("mean |e|"),
        tr("mean"),
        tr("sd"),
        tr("lowest"),
        tr("highest"),
    )
    widths = (1.6, 1.0, 1.1, 0.6, 0.6, 1.0, 1.0, 0.9, 1.0, 1.0)
    return Listing(tr("Errors in percent of the true length"), heads, rows, widths)


def _gauge_section(evaluation: Evaluation, gauge: tuple[GaugeRow, ...]) -> Section:
    facts = tuple(fact for pooled in evaluation.repeatability for fact in _pooled(pooled))
    return Section(
        "gauge",
        tr("Repeatability of the gauge"),
        tr(
            "Repeatability is the standard deviation of presses in one region; reproducibility "
            "is the additional scatter between regions"
        ),
        QualityTable(()),
        facts,
        listings=(gauge_listing(gauge),),
    )


def _pooled(pooled: Repeatability) -> tuple[tuple[str, str], ...]:
    name = {"planar": tr("planar"), "depth": tr("depth")}[pooled.direction]
    return (
        (
            tr("Repeatability, {direction}, all objects").format(direction=name),
            micrometres(pooled.within_region_mm),
        ),
        (
            tr("Reproducibility, {direction}, all objects").format(direction=name),
            micrometres(pooled.between_regions_mm),
        ),
    )


def gauge_listing(gauge: tuple[GaugeRow, ...]) -> Listing:
    """Return the gauge table as text.

    Parameters
    ----------
    gauge : tuple of GaugeRow
        From :func:`~gelpolight_core.measurement.gauge.gauge_rows`.
    """
    rows = tuple(
        (
            label(row.direction),
            label(row.truth.shape),
            f"{row.true_mm:g}",
            str(row.same.count),
            _millimetres(row.same.mean_mm),
            micrometres(row.same.sd_mm),
            str(row.random.count),
            _millimetres(row.random.mean_mm),
            micrometres(row.random.sd_mm),
            micrometres(row.reproducibility_mm),
        )
        for row in gauge
    )
    heads = (
        tr("direction"),
        tr("shape"),
        tr("true (mm)"),
        tr("n, same region"),
        tr("mean (mm)"),
        tr("sd: repeatability"),
        tr("n, random regions"),
        tr("mean (mm)"),
        tr("sd"),
        tr("reproducibility"),
    )
    widths = (1.0, 1.0, 0.8, 0.9, 1.0, 1.2, 1.0, 1.0, 0.9, 1.3)
    return Listing(tr("Object by object"), heads, rows, widths)


def _presses(evaluation: Evaluation) -> Listing:
    heads = (
        tr("image"),
        tr("size (mm)"),
        tr("measured"),
        tr("error"),
        tr("height (mm)"),
        tr("measured"),
        tr("error"),
        tr("verdict"),
    )
    rows = tuple(_press_row(result) for result in evaluation.results)
    return Listing(tr("Every press"), heads, rows, (2.9, 0.8, 1.5, 0.9, 0.9, 1.5, 0.9, 1.6))


def _press_row(result: PressResult) -> tuple[str, ...]:
    truth, found = result.press.truth, result.measurement
    size, height = f"{truth.size_mm:g}", f"{truth.height_mm:g}"
    if found is None:
        return (result.press.file, size, "", "", height, "", "", result.failure)
    return (
        result.press.file,
        size,
        f"{found.size_mm:.3f} {PLUS_MINUS} {found.size_sd_mm:.3f}",
        f"{result.planar_percent:+.2f} %",
        height,
        f"{found.height_mm:.3f} {PLUS_MINUS} {found.sd['height_mm']:.3f}",
        f"{result.depth_percent:+.2f} %",
        f"{label(found.verdict)}: {found.reason}" if found.reason else label(found.verdict),
    )


def _sentence(evaluation: Evaluation) -> str:
    count = len(evaluation.results)
    measured = count - len(evaluation.failed)
    if not measured:
        return tr("None of {n} presses could be measured").format(n=count)
    summary = [tr("{measured} of {n} presses were measured").format(measured=measured, n=count)]
    texts = {
        "planar": tr(
            "mean absolute error in the planar direction {e:.2f} % (paper: about {p:.0f} %)"
        ),
        "depth": tr(
            "mean absolute error in the depth direction {e:.2f} % (paper: about {p:.0f} %)"
        ),
    }
    for direction, text in texts.items():
        error = evaluation.overall(direction).mean_absolute_percent
        if math.isfinite(error):
            summary.append(text.format(e=error, p=PAPER_PERCENT[direction]))
    return "; ".join(summary)


def _percent(value: float, *, sign: bool = False) -> str:
    if not math.isfinite(value):
        return EM_DASH
    return f"{value:+.2f}" if sign else f"{value:.2f}"


def _millimetres(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else EM_DASH


def micrometres(value_mm: float) -> str:
    """Return a length in micrometres as text; a dash where it is not known."""
    return f"{1e3 * value_mm:.1f} \N{MICRO SIGN}m" if math.isfinite(value_mm) else EM_DASH
