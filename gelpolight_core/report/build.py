"""Build the report of a calibration, or of a run with its session's images."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from gelpolight_core.calibration import in_place
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.file import contents_of
from gelpolight_core.calibration.open_sensor import LENS, LIGHTS, RADIANCE, TOP_POSE
from gelpolight_core.calibration.project import Run
from gelpolight_core.calibration.recipes import JOINT, stage_title
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.causes import with_one_cause
from gelpolight_core.finding import Verdict
from gelpolight_core.in_place.calibrate import InPlaceResult
from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.report import drawings, tables
from gelpolight_core.report.document import Listing, Parts, Report, Section, Validation
from gelpolight_core.report.drawing import Map
from gelpolight_core.report.facts import head_facts, stage_facts, stage_intro
from gelpolight_core.sensor_calibration import MODELS, Calibration, OpenSensor
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

MOST_NUMBERS = 100
"""Of an array in the attached data: more than of any array but maps and curves."""


def calibration_report(calibration: Calibration, *, validation: Validation | None = None) -> Report:
    """Return the report of a calibration file, without the parts that need the images.

    Parameters
    ----------
    calibration : Calibration
        Read from its file.
    validation : Validation, optional
        Results on objects of known size; by default none.
    """
    c = calibration
    parts = PARTS[c.model](c.data)
    return _assemble(c, parts, validation)


def run_report(
    run: Run,
    *,
    validation: Validation | None = None,
) -> Report:
    """Return the report of a run: every stage with its images.

    Parameters
    ----------
    run : Run
        A calibration with the results of every stage.
    validation : Validation, optional
        Results on objects of known size; by default none.

    Raises
    ------
    InputError
        If an image can no longer be read.
    """
    return _assemble(run.calibration, RUN_PARTS[run.calibration.model](run), validation)


def _open_parts(c: OpenSensor) -> dict[str, Parts]:
    return {
        "lights": ((drawings.led_plan(c),), (_mirror_leds(c),)),
        "crosstalk": ((), (tables.crosstalk_shares(c.crosstalk),)),
        "radiance": ((drawings.radiance(c),), ()),
        "reflectance": ((drawings.curves(c.reflectance),), ()),
        "factors": ((drawings.factors(c),), ()),
        "joint": ((), _refined_leds(c)),
    }


def _run_parts(run: Run) -> dict[str, Parts]:
    c, session, results = run.calibration.open_sensor, run.session, run.results
    lens, lights, made = results[LENS], results[LIGHTS].leds, results[REFLECTANCE].table
    presses, spots, joint = made.presses, lights.spots, results.get(JOINT)
    mirror = drawings.mirror_spots(spots, session.averaged("mirror").rgb)
    files = [read_image(session.folder / p.name, response=c.response) for p in presses]
    balls = drawings.balls(presses, [c.table.apply(file.rgb) for file in files], c.table)
    curves = drawings.curves(made.table, gather_scatter(run))
    moved = () if joint is None else (tables.refined_presses(presses, joint.refined),)
    return {
        "lens": (
            (
                drawings.lens_views(lens, _named(session, "checkerboard")),
                drawings.lens_residuals(lens),
            ),
            (tables.left_out_views(lens),),
        ),
        "top_pose": (drawings.top_pose(results[TOP_POSE].pose, _named(session, "top_pose")), ()),
        "lights": (
            (mirror, drawings.led_plan(c, lights.bright_points_mm)),
            (_mirror_leds(c), tables.rejected_glints(spots)),
        ),
        "crosstalk": ((), (tables.crosstalk_shares(c.crosstalk),)),
        "radiance": ((drawings.radiance(c, results[RADIANCE]),), ()),
        "reflectance": ((balls, curves), (tables.ball_presses(presses),)),
        "factors": ((drawings.factors(c),), ()),
        "joint": ((), (*_refined_leds(c), *moved)),
    }


def _closed_parts(c: ClosedSensor, result: InPlaceResult | None = None) -> dict[str, Parts]:
    contacts, errors = drawings.contacts(c), drawings.slope_errors(c)
    if result is None:
        return {"balls": ((contacts,), ()), "in_place": ((errors,), ())}
    learning = (drawings.learning(result.learning),) if len(result.learning) > 1 else ()
    return {
        "balls": ((contacts,), (tables.refused_presses(result),)),
        "in_place": ((errors, *learning), (tables.closed_presses(c, result),)),
    }


def _closed_run_parts(run: Run) -> dict[str, Parts]:
    result = run.results[in_place.BALLS].result
    return _closed_parts(run.calibration.data_of(ClosedSensor), result)


def _named(session: Session, stage: str) -> Mapping[str, Map]:
    return {image.name: image.rgb for image in session.images(stage)}


def _mirror_leds(c: OpenSensor) -> Listing:
    sd_mm = np.sqrt(np.diagonal(c.led_covariance_mm2, axis1=1, axis2=2))
    return tables.leds(c.led_positions_mm, sd_mm)


def _refined_leds(c: OpenSensor) -> tuple[Listing, ...]:
    if c.full is None:
        return ()
    leds_mm = c.full.led_positions_mm
    return (tables.leds(leds_mm, c.full.led_sd_mm, leds_mm - c.led_positions_mm),)


def _assemble(c: Calibration, parts: Mapping[str, Parts], validation: Validation | None) -> Report:
    facts = stage_facts(c)
    validation = validation or _not_validated()
    cause, quality = with_one_cause(c.quality)
    sections = tuple(
        Section(
            key,
            stage_title(key),
            stage_intro(key),
            table,
            facts.get(key, ()),
            *parts.get(key, ((), ())),
        )
        for key, table in quality.items()
    )
    sources = tuple(sorted(c.provenance.sources.items()))
    return Report(
        title=tr("Calibration of sensor {serial}").format(serial=c.serial),
        verdict=Verdict.FAIL if validation.verdict is Verdict.FAIL else c.verdict,
        sections=sections,
        cause=cause,
        facts=head_facts(c),
        validation=validation,
        listings=(Listing(tr("Source files"), (tr("file"), "SHA-256"), sources),),
        created=c.provenance.created,
        data={"calibration": _numbers(c)},
    )


def _numbers(c: Calibration) -> dict[str, Any]:
    """Return what a calibration file contains for programs, without maps and figures."""
    manifest, arrays = contents_of(c)
    few = {
        name.removeprefix("data."): array
        for name, array in arrays.items()
        if array.size <= MOST_NUMBERS
    }
    return {key: value for key, value in manifest.items() if key != "quality"} | few


def _not_validated() -> Validation:
    sentence = tr(
        "Not validated: no object of known size was measured with this calibration. A wrong ball "
        "radius, square size or scale makes every result wrong, and no image can show this"
    )
    return Validation(sentence, Verdict.WARN)


PARTS: Mapping[str, Callable[[Any], dict[str, Parts]]] = MappingProxyType(
    {**dict.fromkeys(MODELS, _open_parts), IN_PLACE: _closed_parts}
)
"""Drawings and tables of the calibration of each model."""
RUN_PARTS: Mapping[str, Callable[[Run], dict[str, Parts]]] = MappingProxyType(
    {**dict.fromkeys(MODELS, _run_parts), IN_PLACE: _closed_run_parts}
)
"""The same of a run, with its images."""
