"""Build the report of a calibration, or of a run with its session's images."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.root_causes import cause_and_rest
from gelpolight_core.calibration import closed_sensor_recipe
from gelpolight_core.calibration.calibration_file import contents_of
from gelpolight_core.calibration.closed_sensor.slope_calibration import InPlaceResult
from gelpolight_core.calibration.joint_refinement import JointRefinement
from gelpolight_core.calibration.joint_stage import JOINT
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import (
    BACKGROUND,
    LENS,
    LIGHTS,
    RADIANCE,
    TOP_POSE,
)
from gelpolight_core.calibration.project import CalibrationRun
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.recipes import recipe_named, stage_title
from gelpolight_core.calibration.reflectance_scatter import gather_scatter
from gelpolight_core.output.report import drawings
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
from gelpolight_core.sensor.sensor_calibration import Calibration, OpenSensor
from gelpolight_core.session.session import Session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.checkerboards.lens import LensResult
from gelpolight_core.stages.leds.mirror_spots import MirrorSpots

from .document import Parts, Report, ReportSection, TextTable, ValidationSummary, make_text_table
from .drawing_tools import ColourTable
from .facts import head_facts, stage_facts
from .result_pictures import result_pictures

Colours = ColourTable | None


def crosstalk_shares(crosstalk: Float64Array) -> TextTable:
    """Return the share of each LED's light that the other channels see.

    Parameters
    ----------
    crosstalk : (3, 3)
        ``I_raw = crosstalk @ I_true``; column k is LED k.
    """
    heads = ("", *(f"{CHANNEL_KEYS[k]} LED" for k in range(3)))
    rows = []
    for j, shares in enumerate(crosstalk):
        name = f"seen by the {CHANNEL_KEYS[j]} channel"
        cells = ("" if j == k else f"{100.0 * share:.2f} %" for k, share in enumerate(shares))
        rows.append((name, *cells))
    title = "Share of each LED's light that the other two channels see"
    return TextTable(title, heads, tuple(rows))


def excluded_views(lens: LensResult) -> TextTable:
    """Return the checkerboard views that were left out, each with the reason."""
    return make_text_table(
        "Views left out",
        (view for view in lens.views if not view.used),
        ("image", lambda view: view.name),
        ("reason", lambda view: view.reason),
        ("advice", lambda view: view.advice),
    )


def rejected_glints(spots: MirrorSpots) -> TextTable:
    """Return the spots on the mirror that are no LED, each with the reason."""
    return make_text_table(
        "Rejected glints",
        enumerate(spots.rejected, start=1),
        ("number", lambda item: str(item[0])),
        ("position (px)", lambda item: "({:.1f}, {:.1f})".format(*item[1][0].centre_px)),
        ("reason", lambda item: item[1][1]),
    )


def ball_presses(presses: Sequence[BallPress]) -> TextTable:
    """Return every ball press with its verdict."""

    def verdict(press: BallPress) -> str:
        word = f"{press.quality.verdict.sign} {press.quality.verdict.word}"
        return ": ".join((word, *press.quality.remedies))

    return make_text_table(
        "Ball presses (lengths in mm)",
        presses,
        ("image", lambda press: PurePath(press.name).name),
        ("ball radius", lambda press: f"{press.pose.radius_mm:.3f}"),
        ("centre", lambda press: "({:.3f}, {:.3f})".format(*press.pose.centre_mm)),
        ("depth", lambda press: f"{press.pose.depth_mm:.3f}"),
        ("contact radius", lambda press: f"{press.contact_radius_mm:.3f}"),
        ("misfit", lambda press: f"{100.0 * press.shading_misfit:.1f} %"),
        ("verdict", verdict),
    )


def refined_presses(presses: Sequence[BallPress], joint: JointRefinement) -> TextTable:
    """Return residual and shift of each press by the joint refinement.

    Parameters
    ----------
    presses : sequence of BallPress
        With the misfit of their separate refinement.
    joint : JointRefinement
        With the misfit of each press after the joint refinement.
    """

    def moved(k: int) -> Float64Array:
        before, after = presses[k].pose, joint.balls[k]
        x_mm, y_mm = np.subtract(after.centre_mm, before.centre_mm)
        return 1e3 * np.array([x_mm, y_mm, after.depth_mm - before.depth_mm])

    return make_text_table(
        "Residual of each ball press, and the shift of the balls by the joint refinement",
        range(len(presses)),
        ("image", lambda k: PurePath(presses[k].name).name),
        ("misfit alone", lambda k: f"{100.0 * presses[k].shading_misfit:.2f} %"),
        ("misfit together", lambda k: f"{100.0 * joint.ball_misfits[k]:.2f} %"),
        ("shift in x (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[0]:+.1f}"),
        ("shift in y (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[1]:+.1f}"),
        ("shift in depth (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[2]:+.1f}"),
    )


def closed_presses(c: ClosedSensor, result: InPlaceResult) -> TextTable:
    """Return every press of a closed sensor, compared with the other presses."""

    def percent(ratio: float) -> str:
        return f"{100.0 * (ratio - 1.0):+.1f} %" if math.isfinite(ratio) else ""

    return make_text_table(
        "Each press compared with the other presses",
        zip(c.balls, (press.held_out for press in result.presses), strict=True),
        ("image", lambda press: PurePath(press[0][0]).name),
        ("radius (mm)", lambda press: f"{press[0][4]:.3f}"),
        ("position (mm)", lambda press: f"{press[0][1]:.2f}, {press[0][2]:.2f}"),
        ("contact (mm)", lambda press: f"{press[0][3]:.2f}"),
        ("normals", lambda press: f"{press[1].normal_deg:.2f}\N{DEGREE SIGN}"),
        ("height", lambda press: percent(press[1].cap_ratio)),
        ("diameter", lambda press: percent(press[1].diameter_ratio)),
    )


def refused_presses(result: InPlaceResult) -> TextTable:
    """Return the presses of a closed sensor that were left out, each with the reason."""
    return make_text_table(
        "Presses left out",
        sorted(result.refused.items()),
        ("image", lambda item: PurePath(item[0]).name),
        ("reason", lambda item: f"{item[1].found}. {item[1].advice}."),
    )


def _lens(c: OpenSensor, run: CalibrationRun | None, _: Colours) -> dict[str, Parts]:
    if run is None:
        return {}
    lens, images = run.results[LENS], _named(run.session, LENS.folder)
    figures = drawings.lens_views(lens, images), drawings.lens_residuals(lens)
    return {"lens": (figures, (excluded_views(lens),))}


def _top_pose(c: OpenSensor, run: CalibrationRun | None, _: Colours) -> dict[str, Parts]:
    if run is None:
        return {}
    images = _named(run.session, TOP_POSE.folder)
    return {"top_pose": (drawings.top_pose(run.results[TOP_POSE].pose, images), ())}


def _lights(c: OpenSensor, run: CalibrationRun | None, _: Colours) -> dict[str, Parts]:
    parts: dict[str, Parts] = {"crosstalk": ((), (crosstalk_shares(c.crosstalk),))}
    if run is None:
        return parts
    leds = run.results[LIGHTS].leds
    mirror = drawings.mirror_spots(leds.spots, run.session.averaged(LIGHTS.folder).rgb)
    return {"lights": ((mirror,), (rejected_glints(leds.spots),)), **parts}


def _radiance(c: OpenSensor, run: CalibrationRun | None, colours: Colours) -> dict[str, Parts]:
    result = None if run is None else run.results[BACKGROUND].radiance
    return {"radiance": ((drawings.radiance(c, result, colours),), ())}


def _reflectance(c: OpenSensor, run: CalibrationRun | None, colours: Colours) -> dict[str, Parts]:
    parts: dict[str, Parts] = {"factors": ((drawings.factors(c, colours),), ())}
    if run is None:
        return {"reflectance": ((drawings.curves(c.reflectance),), ()), **parts}
    table = run.results[REFLECTANCE].table
    paths = [run.session.folder / press.name for press in table.presses]
    images = [c.table.apply(read_linear_image(path, response=c.response).rgb) for path in paths]
    balls = drawings.balls(table.presses, images, c.table)
    curves = drawings.curves(table.table, gather_scatter(run))
    return {"reflectance": ((balls, curves), (ball_presses(table.presses),)), **parts}


def _joint(c: OpenSensor, run: CalibrationRun | None, _: Colours) -> dict[str, Parts]:
    joint = None if run is None else run.results.get(JOINT)
    if run is None or joint is None:
        return {}
    presses = run.results[REFLECTANCE].table.presses
    return {"joint": ((), (refined_presses(presses, joint.refined),))}


def _closed(c: ClosedSensor, run: CalibrationRun | None, _: Colours) -> dict[str, Parts]:
    errors = drawings.slope_errors(c)
    if run is None:
        return {"in_place": ((errors,), ())}
    result = run.results[closed_sensor_recipe.BALLS].result
    learning = (drawings.learning(result.learning),) if len(result.learning) > 1 else ()
    return {
        "balls": ((), (refused_presses(result),)),
        "in_place": ((errors, *learning), (closed_presses(c, result),)),
    }


SHOWN: dict[Stage[Any], Callable[[Any, CalibrationRun | None, Colours], dict[str, Parts]]] = {
    LENS: _lens,
    TOP_POSE: _top_pose,
    LIGHTS: _lights,
    RADIANCE: _radiance,
    REFLECTANCE: _reflectance,
    JOINT: _joint,
    closed_sensor_recipe.BALLS: _closed,
}
"""Drawings and listings of the tables of a stage: of a calibration, and of a run if there is one.
"""


def _named(session: Session, stage: str) -> Mapping[str, Float32Array]:
    return {image.name: image.rgb for image in session.images(stage)}


def calibration_report(
    c: Calibration,
    run: CalibrationRun | None = None,
    *,
    validation: ValidationSummary | None = None,
    colours: Colours = None,
) -> Report:
    """Return the report of a calibration.

    Parameters
    ----------
    c : Calibration
        Read from its file, or of the run.
    run : CalibrationRun, optional
        With the results of every stage and their images; without it, the report has only what the
        file holds.
    validation : ValidationSummary, optional
        Results on objects of known size; by default those that the calibration holds.
    colours : (256, 3) uint8, optional
        Colours of the maps.

    Raises
    ------
    InputError
        If an image can no longer be read.
    """
    recipe, facts = recipe_named(c.model), stage_facts(c)
    parts: dict[str, Parts] = {}
    for stage in recipe.stages:
        if show := SHOWN.get(stage):
            parts |= show(c.data, run, colours)
    validation = validation or stated_validation(c)
    cause, quality = cause_and_rest(c.quality)
    pictures = tuple(map(drawings.result_picture, result_pictures(c, run)))
    about = "What measurements with this calibration will be worth"
    result = ReportSection("result", "Result", about, QualityTable(), drawings=pictures)
    sections = (
        result,
        *(
            ReportSection(
                key,
                stage_title(key),
                recipe.tables[key].about if key in recipe.tables else "",
                table,
                facts.get(key, ()),
                *parts.get(key, ((), ())),
            )
            for key, table in quality.items()
        ),
    )
    sources = tuple(sorted(c.provenance.sources.items()))
    return Report(
        title=f"Calibration of sensor {c.serial}",
        verdict=Verdict.FAIL if validation.verdict is Verdict.FAIL else c.verdict,
        sections=sections,
        cause=cause,
        facts=head_facts(c),
        validation=validation,
        listings=(TextTable("Source files", ("file", "SHA-256"), sources),),
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


def stated_validation(c: Calibration) -> ValidationSummary:
    """Return what a calibration says of its validation."""
    if c.validation is not None:
        lines, verdict = c.validation.lines(), c.validation.verdict
        return ValidationSummary(". ".join(lines).rstrip("."), verdict, data=c.validation.as_json())
    sentence = (
        "Not validated: no object of known size was measured with this calibration. A wrong ball "
        "diameter, square size or scale makes every result wrong, and no image can show this"
    )
    return ValidationSummary(sentence, Verdict.WARN)
