"""Build the report of a calibration, or of a run with its session's images."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from gelpolight_core.arrays import Map
from gelpolight_core.calibration import in_place
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.file import contents_of
from gelpolight_core.calibration.open_sensor import BACKGROUND, LENS, LIGHTS, RADIANCE, TOP_POSE
from gelpolight_core.calibration.project import Run
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.recipes import JOINT, recipe_named, stage_title
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.causes import with_one_cause
from gelpolight_core.finding import Verdict
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.report import drawings, tables
from gelpolight_core.report.document import Listing, Parts, Report, Section, Validated
from gelpolight_core.report.facts import head_facts, stage_facts
from gelpolight_core.sensor_calibration import Calibration, OpenSensor
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session


def _lens(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    if run is None:
        return {}
    lens, images = run.results[LENS], _named(run.session, LENS.folder)
    shown = drawings.lens_views(lens, images), drawings.lens_residuals(lens)
    return {"lens": (shown, (tables.left_out_views(lens),))}


def _top_pose(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    if run is None:
        return {}
    images = _named(run.session, TOP_POSE.folder)
    return {"top_pose": (drawings.top_pose(run.results[TOP_POSE].pose, images), ())}


def _lights(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    parts: dict[str, Parts] = {"crosstalk": ((), (tables.crosstalk_shares(c.crosstalk),))}
    if run is None:
        return {"lights": ((drawings.led_plan(c),), ()), **parts}
    found = run.results[LIGHTS].leds
    mirror = drawings.mirror_spots(found.spots, run.session.averaged(LIGHTS.folder).rgb)
    plan = drawings.led_plan(c, found.bright_points_mm)
    return {"lights": ((mirror, plan), (tables.rejected_glints(found.spots),)), **parts}


def _radiance(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    found = None if run is None else run.results[BACKGROUND].radiance
    return {"radiance": ((drawings.radiance(c, found),), ())}


def _reflectance(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    parts: dict[str, Parts] = {"factors": ((drawings.factors(c),), ())}
    if run is None:
        return {"reflectance": ((drawings.curves(c.reflectance),), ()), **parts}
    made = run.results[REFLECTANCE].table
    paths = [run.session.folder / press.name for press in made.presses]
    images = [c.table.apply(read_image(path, response=c.response).rgb) for path in paths]
    balls = drawings.balls(made.presses, images, c.table)
    curves = drawings.curves(made.table, gather_scatter(run))
    return {"reflectance": ((balls, curves), (tables.ball_presses(made.presses),)), **parts}


def _joint(c: OpenSensor, run: Run | None) -> dict[str, Parts]:
    joint = None if run is None else run.results.get(JOINT)
    if run is None or joint is None:
        return {}
    presses = run.results[REFLECTANCE].table.presses
    return {"joint": ((), (tables.refined_presses(presses, joint.refined),))}


def _closed(c: ClosedSensor, run: Run | None) -> dict[str, Parts]:
    contacts, errors = drawings.contacts(c), drawings.slope_errors(c)
    if run is None:
        return {"balls": ((contacts,), ()), "in_place": ((errors,), ())}
    result = run.results[in_place.BALLS].result
    learning = (drawings.learning(result.learning),) if len(result.learning) > 1 else ()
    return {
        "balls": ((contacts,), (tables.refused_presses(result),)),
        "in_place": ((errors, *learning), (tables.closed_presses(c, result),)),
    }


SHOWN: dict[Stage[Any], Callable[[Any, Run | None], dict[str, Parts]]] = {
    LENS: _lens,
    TOP_POSE: _top_pose,
    LIGHTS: _lights,
    RADIANCE: _radiance,
    REFLECTANCE: _reflectance,
    JOINT: _joint,
    in_place.BALLS: _closed,
}
"""Drawings and listings of the tables of a stage: of a calibration, and of a run if there is one.
"""


def _named(session: Session, stage: str) -> Mapping[str, Map]:
    return {image.name: image.rgb for image in session.images(stage)}


def calibration_report(
    c: Calibration, run: Run | None = None, *, validation: Validated | None = None
) -> Report:
    """Return the report of a calibration.

    Parameters
    ----------
    c : Calibration
        Read from its file, or of the run.
    run : Run, optional
        With the results of every stage and their images; without it, the report has only what the
        file holds.
    validation : Validated, optional
        Results on objects of known size; by default those that the calibration holds.

    Raises
    ------
    InputError
        If an image can no longer be read.
    """
    recipe, facts = recipe_named(c.model), stage_facts(c)
    parts: dict[str, Parts] = {}
    for stage in recipe.stages:
        if show := SHOWN.get(stage):
            parts |= show(c.data, run)
    validation = validation or stated_validation(c)
    cause, quality = with_one_cause(c.quality)
    sections = tuple(
        Section(
            key,
            stage_title(key),
            recipe.tables[key].about if key in recipe.tables else "",
            table,
            facts.get(key, ()),
            *parts.get(key, ((), ())),
        )
        for key, table in quality.items()
    )
    sources = tuple(sorted(c.provenance.sources.items()))
    return Report(
        title=f"Calibration of sensor {c.serial}",
        verdict=Verdict.FAIL if validation.verdict is Verdict.FAIL else c.verdict,
        sections=sections,
        cause=cause,
        facts=head_facts(c),
        validation=validation,
        listings=(Listing("Source files", ("file", "SHA-256"), sources),),
        created=c.provenance.created,
        data={"calibration": _numbers(c)},
    )


def _numbers(c: Calibration) -> dict[str, Any]:
    """Return what a calibration file contains for programs, without maps and figures."""
    manifest, arrays = contents_of(c)
    few = {
        name.removeprefix("data."): array
        for name, array in arrays.items()
        # More numbers than any array has but maps and curves.
        if array.size <= 100
    }
    return {key: value for key, value in manifest.items() if key != "quality"} | few


def stated_validation(c: Calibration) -> Validated:
    """Return what a calibration says of its validation."""
    if c.validation is not None:
        lines, verdict = c.validation.lines(), c.validation.verdict
        return Validated("; ".join(lines), verdict, data=c.validation.as_json())
    sentence = (
        "Not validated: no object of known size was measured with this calibration. A wrong ball "
        "diameter, square size or scale makes every result wrong, and no image can show this"
    )
    return Validated(sentence, Verdict.WARN)
