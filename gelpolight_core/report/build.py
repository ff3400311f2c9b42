"""Build the report document from a calibration, or from a run with its session's images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePath

from gelpolight_core.calibration.in_place_session import InPlaceRun
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.calibration.titles import stage_title
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.quality import QualityTable, verdict_word
from gelpolight_core.reconstruction.in_place.calibration import AnyCalibration, InPlaceCalibration
from gelpolight_core.report.ball_drawings import draw_balls, draw_curves, draw_misfits
from gelpolight_core.report.crosstalk_drawing import draw_crosstalk
from gelpolight_core.report.document import (
    MARKS,
    Listing,
    Parts,
    Report,
    Section,
    Validation,
)
from gelpolight_core.report.drawing import Map
from gelpolight_core.report.in_place_parts import in_place_facts, in_place_parts
from gelpolight_core.report.labels import label
from gelpolight_core.report.light_drawings import (
    draw_factors,
    draw_led_moves,
    draw_led_plan,
    draw_mirror_spots,
    draw_radiance,
)
from gelpolight_core.report.optics_drawings import (
    draw_lens_residuals,
    draw_lens_views,
    draw_top_pose,
)
from gelpolight_core.report.stage_facts import stage_facts, stage_intro
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import SensorData, Session
from gelpolight_core.translation import tr


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
    if isinstance(calibration, InPlaceCalibration):
        return _assemble(calibration, in_place_parts(calibration), validation)
    parts: dict[str, Parts] = {
        "lights": Parts((draw_led_plan(calibration),)),
        "crosstalk": Parts((draw_crosstalk(calibration.crosstalk),)),
        "radiance": Parts((draw_radiance(calibration),)),
        "reflectance": Parts((draw_curves(calibration.reflectance),)),
        "factors": Parts((draw_factors(calibration),)),
    }
    if calibration.full is not None:
        parts["joint"] = Parts((draw_led_moves(calibration),))
    return _assemble(calibration, parts, validation)


def run_report(
    run: CalibrationRun, session: Session, *, validation: Validation | None = None
) -> Report:
    """Return the report of a run: every stage with its images.

    Parameters
    ----------
    run : CalibrationRun
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
    c = run.calibration
    parts: dict[str, Parts] = {
        "lens": Parts(
            (
                draw_lens_views(run.lens, _named(session, "checkerboard")),
                draw_lens_residuals(run.lens),
            ),
            _left_out(run),
        ),
        "top_pose": Parts(draw_top_pose(run.top_pose, _named(session, "top_pose"))),
        "lights": Parts(
            (
                draw_mirror_spots(run.lights.spots, session.averaged("mirror").rgb),
                draw_led_plan(c, run.lights.bright_points_mm),
            ),
            _rejected_spots(run),
        ),
        "crosstalk": Parts((draw_crosstalk(c.crosstalk),)),
        "radiance": Parts((draw_radiance(c, run.radiance),)),
        "reflectance": _reflectance_parts(run, session),
        "factors": Parts((draw_factors(c),)),
    }
    if run.joint is not None:
        parts["joint"] = Parts(
            (draw_led_moves(c), draw_misfits(run.reflectance.presses, run.joint))
        )
    return _assemble(c, parts, validation)


def in_place_report(run: InPlaceRun, *, validation: Validation | None = None) -> Report:
    """Return the report of a run with a closed sensor: every press as it was used, or why not.

    Parameters
    ----------
    run : InPlaceRun
        A calibration with its presses.
    validation : Validation, optional
        Results on objects of known size; by default none.
    """
    parts = in_place_parts(run.calibration, run.result)
    return _assemble(run.calibration, parts, validation)


def _named(session: Session, stage: str) -> Mapping[str, Map]:
    return {image.name: image.rgb for image in session.images(stage)}


def _reflectance_parts(run: CalibrationRun, session: Session) -> Parts:
    table, presses = run.calibration.table, run.reflectance.presses
    response = run.calibration.response
    images = [
        table.apply(read_image(session.folder / p.name, response=response).rgb) for p in presses
    ]
    rows = []
    for press in presses:
        advice = "; ".join(press.quality.advice)
        rows.append(
            (
                PurePath(press.name).name,
                f"{press.pose.radius_mm:.3f}",
                "({:.3f}, {:.3f})".format(*press.pose.centre_mm),
                f"{press.pose.depth_mm:.3f}",
                f"{press.contact_radius_mm:.3f}",
                f"{100.0 * press.shading_misfit:.1f} %",
                f"{MARKS[press.quality.verdict]} {verdict_word(press.quality.verdict)}"
                + (f": {advice}" if advice else ""),
            )
        )
    listing = Listing(
        tr("Ball presses (lengths in mm)"),
        (
            tr("image"),
            tr("ball radius"),
            tr("centre"),
            tr("depth"),
            tr("contact radius"),
            tr("misfit"),
            tr("verdict"),
        ),
        tuple(rows),
        (1.5, 0.9, 1.7, 0.8, 1.0, 0.8, 3.2),
    )
    return Parts(
        (
            draw_balls(presses, images, table),
            draw_curves(run.reflectance.table, gather_scatter(run, session)),
        ),
        (listing,),
    )


def _left_out(run: CalibrationRun) -> tuple[Listing, ...]:
    rows = tuple((v.name, v.reason, v.advice) for v in run.lens.views if not v.used)
    if not rows:
        return ()
    heads = (tr("image"), tr("reason"), tr("advice"))
    return (Listing(tr("Views left out"), heads, rows, (1.0, 2.0, 2.0)),)


def _rejected_spots(run: CalibrationRun) -> tuple[Listing, ...]:
    rows = tuple(
        (str(number), "({:.1f}, {:.1f})".format(*spot.centre_px), reason)
        for number, (spot, reason) in enumerate(run.lights.spots.rejected, start=1)
    )
    if not rows:
        return ()
    heads = (tr("number"), tr("position (px)"), tr("reason"))
    return (Listing(tr("Rejected glints"), heads, rows, (0.5, 1.0, 4.0)),)


def _assemble(
    c: AnyCalibration, parts: Mapping[str, Parts], validation: Validation | None
) -> Report:
    sections = tuple(
        replace(
            _section(c, key, table),
            drawings=parts.get(key, Parts()).drawings,
            listings=parts.get(key, Parts()).listings,
        )
        for key, table in c.quality.items()
    )
    return Report(
        title=tr("Calibration of sensor {serial}").format(serial=c.sensor.serial),
        verdict=c.verdict,
        facts=_head_facts(c),
        validation=validation or Validation(_not_validated(c)),
        sections=sections,
        sources=Listing(
            tr("Source files"),
            (tr("file"), "SHA-256"),
            tuple(sorted(c.provenance.sources.items())),
            (1.0, 2.6),
            fixed_width=True,
        ),
    )


def _section(c: AnyCalibration, key: str, quality: QualityTable) -> Section:
    facts = () if isinstance(c, InPlaceCalibration) else stage_facts(c, key)
    return Section(key, stage_title(key), stage_intro(key), quality, facts)


def _head_facts(c: AnyCalibration) -> tuple[tuple[str, str], ...]:
    p = c.provenance
    models = {"paper": tr("paper"), "full": tr("full"), "in-place": tr("in place, closed sensor")}
    rows = [
        (tr("Sensor"), c.sensor.serial),
        (tr("Elastomer"), p.elastomer or tr("not stated")),
        (tr("Calibration"), c.identity),
        (tr("Model"), models.get(c.model, c.model)),
        (tr("Created"), f"{p.created}, {p.operator}".rstrip(", ")),
        (tr("Program"), f"GelPoLight Studio {p.program_version}"),
        (tr("Session"), tr("{name} ({n} files)").format(name=p.session, n=len(p.sources))),
    ]
    rows += in_place_facts(c) if isinstance(c, InPlaceCalibration) else _sensor_facts(c.sensor)
    rows += [
        (
            tr("Edited by hand"),
            f"{label(edit.part)} ({', '.join(label(c) for c in edit.channels)}), "
            f"{edit.made}, {edit.operator}".rstrip(", "),
        )
        for edit in p.edits
    ]
    if p.accepted:
        rows.append((tr("Used although it failed"), p.accepted))
    rows += [(key, value) for key, value in sorted(p.camera_settings.items())]
    return tuple(rows)


def _sensor_facts(s: SensorData) -> list[tuple[str, str]]:
    window = (
        tr("none")
        if s.window_thickness_mm == 0.0
        else f"{s.window_thickness_mm:g} mm, n {s.window_refractive_index:g}"
    )
    return [
        (
            tr("Elastomer"),
            f"{s.elastomer_thickness_mm:g} mm, n {s.elastomer_refractive_index:g}",
        ),
        (tr("Window"), window),
        (tr("LED height Z1"), f"{s.led_height_mm:g} mm"),
        (tr("Working diameter"), f"{s.working_diameter_mm:g} mm"),
    ]


def _not_validated(c: AnyCalibration) -> str:
    if isinstance(c, InPlaceCalibration):
        return tr(
            "Not validated: no object of known size was measured with this calibration. A wrong "
            "ball radius or scale makes every result wrong, and no image can show this"
        )
    return tr(
        "Not validated: no object of known size was measured with this calibration. A wrong ball "
        "radius or square size scales every result, and no image can show this"
    )


def validation_of(evaluation: Evaluation) -> Validation:
    """Return the validation of a calibration from an evaluation on presses of known size.

    Parameters
    ----------
    evaluation : Evaluation
        Made with the calibration.
    """
    measured = len(evaluation.results) - len(evaluation.failed)
    sentence = tr("{measured} of {n} presses of known objects were measured").format(
        measured=measured, n=len(evaluation.results)
    )
    if measured:
        sentence = tr(
            "Validated: {first}; mean absolute error {planar:.1f} % in size and {depth:.1f} % "
            "in height"
        ).format(
            first=sentence,
            planar=evaluation.overall("planar").mean_absolute_percent,
            depth=evaluation.overall("depth").mean_absolute_percent,
        )
    else:
        sentence = tr("Not validated: {first}").format(first=sentence)
    return Validation(sentence, _validation_listing(evaluation))


def _validation_listing(evaluation: Evaluation) -> Listing:
    rows: list[tuple[str, ...]] = []
    for result in evaluation.results:
        truth, found = result.press.truth, result.measurement
        row: tuple[str, ...] = (result.press.file, label(truth.shape), f"{truth.size_mm:.3f}")
        if found is None:
            row += ("", "", f"{truth.height_mm:.3f}", "", "", result.failure)
        else:
            row += (
                f"{found.size_mm:.3f} \N{PLUS-MINUS SIGN} {found.size_sd_mm:.3f}",
                f"{result.planar_percent:+.2f} %",
                f"{truth.height_mm:.3f}",
                f"{found.height_mm:.3f} \N{PLUS-MINUS SIGN} {found.sd['height_mm']:.3f}",
                f"{result.depth_percent:+.2f} %",
                f"{label(found.verdict)}: {found.reason}" if found.reason else label(found.verdict),
            )
        rows.append(row)
    heads = (
        tr("image"),
        tr("shape"),
        tr("size (mm)"),
        tr("measured"),
        tr("error"),
        tr("height (mm)"),
        tr("measured"),
        tr("error"),
        tr("verdict"),
    )
    widths = (2.1, 0.9, 0.7, 1.4, 0.8, 0.8, 1.4, 0.8, 1.3)
    return Listing(tr("Objects of known size"), heads, tuple(rows), widths)
