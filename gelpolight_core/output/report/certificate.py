"""The certificate of measured objects: sizes, uncertainty budgets, references and decisions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime

import cv2
import numpy as np

from gelpolight_core.base.compared_quantity import COVERAGE, SOURCES, TOLERANCE_PERCENT, Quantity
from gelpolight_core.base.finding import QualityTable, join_quality_tables
from gelpolight_core.calibration.recipe import Facts
from gelpolight_core.measurement.profile import take_profile
from gelpolight_core.measurement.result import MeasuredPress, compare_with_truth
from gelpolight_core.output.drawing_thread import Figure
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.reference_object import ReferenceObject

from .calibration_report import stated_validation
from .document import Report, ReportSection, TextTable, make_text_table, number_text
from .drawing_tools import ACCENT, MAP_PX, ColourTable, colour_map, drawing
from .facts import head_facts


def measurement_report(
    calibration: Calibration,
    images: Sequence[MeasuredPress],
    *,
    limits_percent: tuple[float, float] = TOLERANCE_PERCENT,
    operator: str = "",
    colours: ColourTable | None = None,
) -> Report:
    """Return the certificate of measured objects.

    The attached data hold every number that the decisions need.

    Parameters
    ----------
    calibration : Calibration
        Used for all of them.
    images : sequence of MeasuredPress
        One section each.
    limits_percent : (float, float), optional
        Tolerances of size and height.
    operator : str, optional
        Who measured.
    colours : (256, 3) uint8, optional
        Colours of the height maps.
    """
    about = (
        "U is the expanded uncertainty (k = 2, about 95 %) of the deviation from the reference, or "
        "of the value without one. The object conforms where deviation and U together are within "
        "the tolerance, and does not conform where they cannot be (ISO 14253-1)"
    )
    sections = tuple(
        _section(image, limits_percent, "" if number else about, colours)
        for number, image in enumerate(images)
    )
    quality = join_quality_tables(section.quality for section in sections)
    # Without a reference there is nothing to decide.
    judged = any(figure.key == "deviation" for figure in quality.figures)
    why = "; ".join(quality.remedies)
    by = (("Measured by", operator),) if operator else ()
    of_calibration = ("Verdict of the calibration", calibration.verdict.word)
    return Report(
        title=f"Measurement with sensor {calibration.serial}",
        verdict=quality.verdict if judged else None,
        sections=sections,
        cause=why if judged else "No decision: no true value of a measured quantity is stated",
        facts=(*by, *head_facts(calibration), of_calibration),
        validation=stated_validation(calibration),
        created=datetime.now().astimezone().isoformat(timespec="seconds"),
        data={
            "calibration": calibration.identity,
            "coverage_factor": COVERAGE,
            "measurements": [
                {"image": image.name, "sha256": image.sha256}
                | image.measurement.as_json(image.truth, limits_percent)
                for image in images
            ],
        },
    )


def _section(
    image: MeasuredPress,
    limits_percent: tuple[float, float],
    about: str,
    colours: ColourTable | None,
) -> ReportSection:
    quantities = compare_with_truth(image.measurement, image.truth, limits_percent)
    decisions = [finding for quantity in quantities for finding in quantity.findings]
    reference = () if image.truth is None else image.truth.findings()
    return ReportSection(
        image.name,
        f"{image.name}: {image.measurement.shape}",
        about,
        QualityTable((*image.measurement.findings, *reference, *decisions)),
        _facts(image),
        (_draw_press(image, colours),),
        (_sizes(quantities), _budget(quantities)),
    )


def _facts(image: MeasuredPress) -> Facts:
    measurement, truth = image.measurement, image.truth or ReferenceObject(image.measurement.shape)
    reference = (
        ("Measured", image.time.astimezone().isoformat(" ", "seconds")),
        ("Centre (x, y)", "{:.3f}, {:.3f} mm".format(*measurement.centre_mm)),
        ("Edge radius", number_text(measurement.edge_radius_mm, ".3f", " mm")),
        ("Decay length of the membrane", f"{measurement.drape_decay_mm:.3f} mm"),
        ("Reference", truth.serial),
        ("Certificate of the reference", truth.certificate),
        ("Valid until", truth.due),
        ("SHA-256 of the image", image.sha256),
    )
    return tuple((name, value) for name, value in reference if value)


def _sizes(quantities: Sequence[Quantity]) -> TextTable:
    return make_text_table(
        "Sizes",
        quantities,
        ("quantity", lambda q: q.label),
        ("measured (mm)", lambda q: f"{q.value:.4f}"),
        ("reference (mm)", lambda q: number_text(q.truth, ".4f")),
        ("U of the reference", lambda q: number_text(q.truth_expanded, ".4f")),
        ("deviation (mm)", lambda q: number_text(q.error, "+z.4f")),
        ("U (mm)", lambda q: f"{q.deviation_expanded:.4f}"),
        ("En", lambda q: number_text(q.en, ".2f")),
        ("tolerance", lambda q: number_text(q.truth and q.limit_percent, "g", " %")),
        ("decision", lambda q: q.decision or ""),
    )


def _budget(quantities: Sequence[Quantity]) -> TextTable:
    rows = [(quantity, *row) for quantity in quantities for row in quantity.budget]
    return make_text_table(
        "Standard uncertainties by source",
        rows,
        ("quantity", lambda row: row[0].label),
        ("source", lambda row: SOURCES.get(row[1], row[1])),
        ("u (mm)", lambda row: f"{row[2]:.5f}"),
        ("share of the variance", lambda row: f"{_share(row[0], row[2]):.0f} %"),
    )


def _share(quantity: Quantity, sd: float) -> float:
    whole = (quantity.deviation_expanded / COVERAGE) ** 2
    return 100.0 * sd**2 / whole if whole else math.nan


@drawing(62.0)
def _draw_press(figure: Figure, image: MeasuredPress, colours: ColourTable | None) -> str:
    """Show the height map with the contact, and the depth along a line across it."""
    heightmap, measurement = image.height_map, image.measurement
    x, y = heightmap.x_mm, heightmap.y_mm
    fine = min(MAP_PX / x.size, 1.0)
    depth = cv2.resize(heightmap.depth_mm, None, fx=fine, fy=fine, interpolation=cv2.INTER_AREA)
    plan, section = figure.subplots(1, 2, width_ratios=(1.0, 1.4))
    drawn = plan.imshow(depth, extent=(x[0], x[-1], y[-1], y[0]), cmap=colour_map(colours))
    plan.plot(
        *np.vstack([measurement.outline_mm, measurement.outline_mm[:1]]).T, color=ACCENT, lw=0.8
    )
    plan.set(xlabel="x (mm)", ylabel="y (mm)")
    figure.colorbar(drawn, ax=plan, label="depth (mm)", shrink=0.8, pad=0.01)
    angle = math.radians(measurement.yaw_deg or 0.0)
    along = measurement.size_mm * np.array([math.cos(angle), math.sin(angle)])
    low, high = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
    start, end = (np.clip(np.add(measurement.centre_mm, s * along), low, high) for s in (-1.0, 1.0))
    line = take_profile(heightmap, tuple(start), tuple(end))
    plan.plot(*np.stack([start, end]).T, color="white", lw=0.6)
    section.plot(line.along_mm, line.depth_mm, color="0.2", lw=0.9)
    for level in (measurement.baseline_mm, measurement.baseline_mm + measurement.height_mm):
        section.axhline(level, color=ACCENT, lw=0.7, ls="--")
    section.set(xlabel="along the line (mm)", ylabel="depth (mm)")
    return (
        "Height map with the contact, and depth along the white line; dashed: the level of the "
        "membrane around the object, and its measured height"
    )
