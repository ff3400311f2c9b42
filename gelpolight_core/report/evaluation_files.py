"""All files of an evaluation: text, CSV, JSON, figure, and the report as HTML and PDF."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.measurement.evaluation import PAPER_PERCENT, Evaluation
from gelpolight_core.measurement.evaluation_report import write_evaluation
from gelpolight_core.measurement.gauge import GaugeRow, gauge_rows
from gelpolight_core.reconstruction.in_place.calibration import AnyCalibration
from gelpolight_core.report.evaluation_document import evaluation_document
from gelpolight_core.report.file import write_report
from gelpolight_core.translation import tr

GAUGE_COLUMNS = (
    "direction",
    "shape",
    "size_mm",
    "height_mm",
    "same_region_n",
    "same_region_mean_mm",
    "repeatability_sd_mm",
    "random_regions_n",
    "random_regions_mean_mm",
    "random_regions_sd_mm",
    "reproducibility_sd_mm",
)


def write_evaluation_files(
    evaluation: Evaluation,
    folder: Path,
    *,
    calibration: AnyCalibration | None = None,
    limits_percent: tuple[float, float] = (PAPER_PERCENT["planar"], PAPER_PERCENT["depth"]),
) -> tuple[Path, ...]:
    """Write ``evaluation.txt``, ``.csv``, ``.json``, ``.png``, ``.html``, ``.pdf`` and a gauge CSV.

    Parameters
    ----------
    evaluation : Evaluation
        Presses compared with their truth.
    folder : Path
        Destination; it must exist.
    calibration : Calibration, optional
        Named in the report.
    limits_percent : (float, float), optional
        Largest mean absolute errors, planar and in depth, for it to pass.

    Returns
    -------
    tuple of Path
        The files written; ``gauge.csv`` only if presses have regions.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    written = list(write_evaluation(evaluation, folder))
    document = evaluation_document(
        evaluation, facts=calibration_facts(calibration), limits_percent=limits_percent
    )
    for ending in (".html", ".pdf"):
        path = folder / f"evaluation{ending}"
        write_report(document, path)
        written.append(path)
    gauge = gauge_rows(evaluation)
    if gauge:
        path = folder / "gauge.csv"
        text = gauge_csv(gauge)
        write_atomically(path, lambda stream: stream.write(text.encode()))
        written.append(path)
    return tuple(written)


def calibration_facts(calibration: AnyCalibration | None) -> tuple[tuple[str, str], ...]:
    """Return the facts about a calibration for the head of a report."""
    if calibration is None:
        return ()
    made = calibration.provenance
    return (
        (tr("Sensor"), calibration.sensor.serial),
        (tr("Calibration"), calibration.identity),
        (tr("Created"), f"{made.created}, {made.operator}".rstrip(", ")),
        (tr("Program"), f"GelPoLight Studio {made.program_version}"),
    )


def gauge_csv(gauge: tuple[GaugeRow, ...]) -> str:
    """Return the gauge table as CSV, one line for each object and direction."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(GAUGE_COLUMNS)
    for row in gauge:
        lengths = (
            [row.same.count, row.same.mean_mm, row.same.sd_mm],
            [row.random.count, row.random.mean_mm, row.random.sd_mm, row.reproducibility_mm],
        )
        cells = ["" if math.isnan(value) else value for part in lengths for value in part]
        truth = row.truth
        writer.writerow([row.direction, truth.shape, truth.size_mm, truth.height_mm, *cells])
    return text.getvalue()
