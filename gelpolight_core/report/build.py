"""Build the report of a calibration, or of a run with its session's images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gelpolight_core.calibration.file import arrays_of, manifest_of
from gelpolight_core.calibration.in_place_session import InPlaceRun
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.calibration.titles import stage_title
from gelpolight_core.finding import Verdict
from gelpolight_core.in_place.calibrate import InPlaceResult
from gelpolight_core.reconstruction.in_place.calibration import AnyCalibration, InPlaceCalibration
from gelpolight_core.report import drawings, tables
from gelpolight_core.report.document import Listing, Parts, Report, Section, Validation
from gelpolight_core.report.drawing import Map
from gelpolight_core.report.facts import head_facts, stage_facts, stage_intro
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

MOST_NUMBERS = 100
"""Of an array in the attached data: more than of any array but maps and curves."""


def calibration_report(
    calibration: AnyCalibration, *, validation: Validation | None = None
) -> Report:
    """Return the report of a calibration file, without the parts that need the images.

    Parameters
    ----------
    calibration : Calibration or InPlaceCalibration
        Read from its file.
    validation : Validation, optional
        Results on objects of known size; by default none.
    """
    c = calibration
    parts = _closed_parts(c, None) if isinstance(c, InPlaceCalibration) else _open_parts(c)
    return _assemble(c, parts, validation)


def run_report(
    run: CalibrationRun | InPlaceRun,
    session: Session,
    *,
    validation: Validation | None = None,
) -> Report:
    """Return the report of a run: every stage with its images.

    Parameters
    ----------
    run : CalibrationRun or InPlaceRun
        A calibration with the results of every stage.
    session : Session
        The session of the run, for the images.
    validation : Validation, optional
        Results on objects of known size; by default none.

    Raises
    ------
    InputError
        If an image can no longer be read.
    """
    if isinstance(run, InPlaceRun):
        parts = _closed_parts(run.calibration, run.result)
    else:
        parts = _run_parts(run, session)
    return _assemble(run.calibration, parts, validation)


def _open_parts(c: Calibration) -> dict[str, Parts]:
    return {
        "lights": ((drawings.led_plan(c),), (_mirror_leds(c),)),
        "crosstalk": ((), (tables.crosstalk_shares(c.crosstalk),)),
        "radiance": ((drawings.radiance(c),), ()),
        "reflectance": ((drawings.curves(c.reflectance),), ()),
        "factors": ((drawings.factors(c),), ()),
        "joint": ((), _refined_leds(c)),
    }


def _run_parts(run: CalibrationRun, session: Session) -> dict[str, Parts]:
    c, presses, spots = run.calibration, run.reflectance.presses, run.lights.spots
    mirror = drawings.mirror_spots(spots, session.averaged("mirror").rgb)
    files = [read_image(session.folder / p.name, response=c.response) for p in presses]
    balls = drawings.balls(presses, [c.table.apply(file.rgb) for file in files], c.table)
    curves = drawings.curves(run.reflectance.table, gather_scatter(run, session))
    moved = () if run.joint is None else (tables.refined_presses(presses, run.joint),)
    return {
        "lens": (
            (
                drawings.lens_views(run.lens, _named(session, "checkerboard")),
                drawings.lens_residuals(run.lens),
            ),
            (tables.left_out_views(run.lens),),
        ),
        "top_pose": (drawings.top_pose(run.top_pose, _named(session, "top_pose")), ()),
        "lights": (
            (mirror, drawings.led_plan(c, run.lights.bright_points_mm)),
            (_mirror_leds(c), tables.rejected_glints(spots)),
        ),
        "crosstalk": ((), (tables.crosstalk_shares(c.crosstalk),)),
        "radiance": ((drawings.radiance(c, run.radiance),), ()),
        "reflectance": ((balls, curves), (tables.ball_presses(presses),)),
        "factors": ((drawings.factors(c),), ()),
        "joint": ((), (*_refined_leds(c), *moved)),
    }


def _closed_parts(c: InPlaceCalibration, result: InPlaceResult | None) -> dict[str, Parts]:
    contacts, errors = drawings.contacts(c), drawings.slope_errors(c)
    if result is None:
        return {"balls": ((contacts,), ()), "in_place": ((errors,), ())}
    learning = (drawings.learning(result.learning),) if len(result.learning) > 1 else ()
    return {
        "balls": ((contacts,), (tables.refused_presses(result),)),
        "in_place": ((errors, *learning), (tables.closed_presses(c, result),)),
    }


def _named(session: Session, stage: str) -> Mapping[str, Map]:
    return {image.name: image.rgb for image in session.images(stage)}


def _mirror_leds(c: Calibration) -> Listing:
    sd_mm = np.sqrt(np.diagonal(c.led_covariance_mm2, axis1=1, axis2=2))
    return tables.leds(c.led_positions_mm, sd_mm)


def _refined_leds(c: Calibration) -> tuple[Listing, ...]:
    if c.full is None:
        return ()
    leds_mm = c.full.led_positions_mm
    return (tables.leds(leds_mm, c.full.led_sd_mm, leds_mm - c.led_positions_mm),)


def _assemble(
    c: AnyCalibration, parts: Mapping[str, Parts], validation: Validation | None
) -> Report:
    facts = {} if isinstance(c, InPlaceCalibration) else stage_facts(c)
    validation = validation or _not_validated(c)
    sections = tuple(
        Section(
            key,
            stage_title(key),
            stage_intro(key),
            quality,
            facts.get(key, ()),
            *parts.get(key, ((), ())),
        )
        for key, quality in c.quality.items()
    )
    sources = tuple(sorted(c.provenance.sources.items()))
    return Report(
        title=tr("Calibration of sensor {serial}").format(serial=c.sensor.serial),
        verdict=Verdict.FAIL if validation.verdict is Verdict.FAIL else c.verdict,
        sections=sections,
        facts=head_facts(c),
        validation=validation,
        listings=(Listing(tr("Source files"), (tr("file"), "SHA-256"), sources),),
        created=c.provenance.created,
        data={"calibration": _numbers(c)},
    )


def _numbers(c: AnyCalibration) -> dict[str, Any]:
    """Return what a calibration file contains for programs, without maps and figures."""
    manifest = {key: value for key, value in manifest_of(c).items() if key != "quality"}
    arrays = arrays_of(c).items()
    return manifest | {name: array for name, array in arrays if array.size <= MOST_NUMBERS}


def _not_validated(c: AnyCalibration) -> Validation:
    if isinstance(c, InPlaceCalibration):
        sentence = tr(
            "Not validated: no object of known size was measured with this calibration. A wrong "
            "ball radius or scale makes every result wrong, and no image can show this"
        )
    else:
        sentence = tr(
            "Not validated: no object of known size was measured with this calibration. A wrong "
            "ball radius or square size scales every result, and no image can show this"
        )
    return Validation(sentence, Verdict.WARN)
