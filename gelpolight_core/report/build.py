"""From a calibration, or a run with its session's pictures, to the report's document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import PurePath

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.calibration.titles import stage_title
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.quality import QualityTable, verdict_word
from gelpolight_core.report.ball_drawings import draw_balls, draw_curves, draw_misfits
from gelpolight_core.report.crosstalk_drawing import draw_crosstalk
from gelpolight_core.report.document import (
    MARKS,
    Drawing,
    Listing,
    Report,
    Section,
    Validation,
)
from gelpolight_core.report.drawing import Map
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
from gelpolight_core.session.session import Session, read_picture
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class _Parts:
    """What a run adds to a stage's section."""

    drawings: tuple[Drawing, ...] = ()
    listings: tuple[Listing, ...] = ()


def calibration_report(calibration: Calibration, *, validation: Validation | None = None) -> Report:
    """Return the report of a calibration file: all but what only the pictures show.

    Parameters
    ----------
    calibration : Calibration
        As read from its file.
    validation : Validation, optional
        What is known from objects of known size; by default, that nothing is.
    """
    parts: dict[str, _Parts] = {
        "lights": _Parts((draw_led_plan(calibration),)),
        "crosstalk": _Parts((draw_crosstalk(calibration.crosstalk),)),
        "radiance": _Parts((draw_radiance(calibration),)),
        "reflectance": _Parts((draw_curves(calibration.reflectance),)),
        "factors": _Parts((draw_factors(calibration),)),
    }
    if calibration.full is not None:
        parts["joint"] = _Parts((draw_led_moves(calibration),))
    return _assemble(calibration, parts, validation)


def run_report(
    run: CalibrationRun, session: Session, *, validation: Validation | None = None
) -> Report:
    """Return the report of a run: every stage with its pictures.

    Parameters
    ----------
    run : CalibrationRun
        A calibration with the results of every stage.
    session : Session
        The one that it was made from, for the pictures.
    validation : Validation, optional
        What is known from objects of known size; by default, that nothing is.

    Raises
    ------
    InputError
        If a picture cannot be read any more.
    """
    c = run.calibration
    parts: dict[str, _Parts] = {
        "lens": _Parts(
            (
                draw_lens_views(run.lens, _named(session, "checkerboard")),
                draw_lens_residuals(run.lens),
            ),
            _left_out(run),
        ),
        "top_pose": _Parts(draw_top_pose(run.top_pose, _named(session, "top_pose"))),
        "lights": _Parts(
            (
                draw_mirror_spots(run.lights.spots, session.averaged("mirror").rgb),
                draw_led_plan(c, run.lights.bright_points_mm),
            ),
            _rejected_spots(run),
        ),
        "crosstalk": _Parts((draw_crosstalk(c.crosstalk),)),
        "radiance": _Parts((draw_radiance(c, run.radiance),)),
        "reflectance": _reflectance_parts(run, session),
        "factors": _Parts((draw_factors(c),)),
    }
    if run.joint is not None:
        parts["joint"] = _Parts(
            (draw_led_moves(c), draw_misfits(run.reflectance.presses, run.joint))
        )
    return _assemble(c, parts, validation)


def _named(session: Session, stage: str) -> Mapping[str, Map]:
    return {picture.name: picture.rgb for picture in session.pictures(stage)}


def _reflectance_parts(run: CalibrationRun, session: Session) -> _Parts:
    table, presses = run.calibration.table, run.reflectance.presses
    response = run.calibration.response
    pictures = [
        table.apply(read_picture(session.folder / p.name, response=response).rgb) for p in presses
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
            tr("picture"),
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
    return _Parts(
        (
            draw_balls(presses, pictures, table),
            draw_curves(run.reflectance.table, gather_scatter(run, session)),
        ),
        (listing,),
    )


def _left_out(run: CalibrationRun) -> tuple[Listing, ...]:
    rows = tuple((v.name, v.reason, v.advice) for v in run.lens.views if not v.used)
    if not rows:
        return ()
    heads = (tr("picture"), tr("why"), tr("advice"))
    return (Listing(tr("Views that were left out"), heads, rows, (1.0, 2.0, 2.0)),)


def _rejected_spots(run: CalibrationRun) -> tuple[Listing, ...]:
    rows = tuple(
        (str(number), "({:.1f}, {:.1f})".format(*spot.centre_px), reason)
        for number, (spot, reason) in enumerate(run.lights.spots.rejected, start=1)
    )
    if not rows:
        return ()
    heads = (tr("number"), tr("place (px)"), tr("why"))
    return (Listing(tr("Glints that were rejected"), heads, rows, (0.5, 1.0, 4.0)),)


def _assemble(c: Calibration, parts: Mapping[str, _Parts], validation: Validation | None) -> Report:
    sections = tuple(
        replace(
            _section(c, key, table),
            drawings=parts.get(key, _Parts()).drawings,
            listings=parts.get(key, _Parts()).listings,
        )
        for key, table in c.quality.items()
    )
    return Report(
        title=tr("Calibration of sensor {serial}").format(serial=c.sensor.serial),
        verdict=c.verdict,
        facts=_head_facts(c),
        validation=validation or Validation(_not_validated()),
        sections=sections,
        sources=Listing(
            tr("Source files"),
            (tr("file"), "SHA-256"),
            tuple(sorted(c.provenance.sources.items())),
            (1.0, 2.6),
            fixed_width=True,
        ),
    )


def _section(c: Calibration, key: str, quality: QualityTable) -> Section:
    return Section(key, stage_title(key), stage_intro(key), quality, stage_facts(c, key))


def _head_facts(c: Calibration) -> tuple[tuple[str, str], ...]:
    p, s = c.provenance, c.sensor
    window = (
        tr("none")
        if s.window_thickness_mm == 0.0
        else f"{s.window_thickness_mm:g} mm, n {s.window_refractive_index:g}"
    )
    rows = [
        (tr("Sensor"), s.serial),
        (tr("Calibration"), c.identity),
        (tr("Model"), {"paper": tr("the paper's"), "full": tr("full")}.get(c.model, c.model)),
        (tr("Made"), f"{p.created}, {p.operator}".rstrip(", ")),
        (tr("Program"), f"GelPoLight Studio {p.program_version}"),
        (tr("Session"), tr("{name} ({n} files)").format(name=p.session, n=len(p.sources))),
        (
            tr("Elastomer"),
            f"{s.elastomer_thickness_mm:g} mm, n {s.elastomer_refractive_index:g}",
        ),
        (tr("Window"), window),
        (tr("LED height Z1"), f"{s.led_height_mm:g} mm"),
        (tr("Working diameter"), f"{s.working_diameter_mm:g} mm"),
    ]
    rows += [
        (
            tr("Changed by hand"),
            f"{tr(edit.part)} ({', '.join(tr(c) for c in edit.channels)}), "
            f"{edit.made}, {edit.operator}".rstrip(", "),
        )
        for edit in p.edits
    ]
    rows += [(key, value) for key, value in sorted(p.camera_settings.items())]
    return tuple(rows)


def _not_validated() -> str:
    return tr(
        "Not validated: no object of known size was measured with this calibration. A wrong ball "
        "radius or square size scales every result, and no picture can tell"
    )


def validation_of(evaluation: Evaluation) -> Validation:
    """Return what an evaluation on presses of known size says of a calibration.

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
        row: tuple[str, ...] = (result.press.file, tr(truth.shape), f"{truth.size_mm:.3f}")
        if found is None:
            row += ("", "", f"{truth.height_mm:.3f}", "", "", result.failure)
        else:
            row += (
                f"{found.size_mm:.3f} \N{PLUS-MINUS SIGN} {found.size_sd_mm:.3f}",
                f"{result.planar_percent:+.2f} %",
                f"{truth.height_mm:.3f}",
                f"{found.height_mm:.3f} \N{PLUS-MINUS SIGN} {found.sd['height_mm']:.3f}",
                f"{result.depth_percent:+.2f} %",
                found.verdict if not found.reason else f"{found.verdict}: {found.reason}",
            )
        rows.append(row)
    heads = (
        tr("picture"),
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
