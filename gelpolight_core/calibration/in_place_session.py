"""Calibrate a closed sensor from its session folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.provenance import provenance_of
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Finding, QualityTable, judge
from gelpolight_core.image.linear import LinearImage, require_size
from gelpolight_core.in_place.ball import Ball
from gelpolight_core.in_place.calibrate import (
    LEAST_PRESSES,
    InPlaceResult,
    PressImage,
    calibrate_in_place,
)
from gelpolight_core.in_place.roundness import judge_stretch
from gelpolight_core.in_place.scale import MeasuredScale, scale_from_pins, scale_from_punch
from gelpolight_core.io.reading import as_text
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor, InPlaceCalibration
from gelpolight_core.reconstruction.in_place.grid import ImageSize, WorkingGrid
from gelpolight_core.reflectance.contour import Circle
from gelpolight_core.sensor_calibration import HandEdit
from gelpolight_core.session.file_hashes import refuse_copies
from gelpolight_core.session.images import require_colour
from gelpolight_core.session.missing import CLOSED_STAGES
from gelpolight_core.session.session import InPlace, Session
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]

STATED_SCALE_SD = 0.01
"""Relative standard deviation of a scale that is stated without one."""
ENOUGH_BALLS = 8
SETTLED = 0.03
"""Gain of a further ball, relative to the error, below which more balls do not help."""


@dataclass(frozen=True, slots=True)
class InPlaceRun:
    """A closed sensor's calibration with what it was made from.

    Attributes
    ----------
    calibration : InPlaceCalibration
        The calibration.
    result : InPlaceResult
        Presses, ridge and figures.
    scale : MeasuredScale or None
        As measured on ``scale/``; None where it is stated.
    """

    calibration: InPlaceCalibration
    result: InPlaceResult
    scale: MeasuredScale | None = None


def calibrate_closed_session(
    session: Session,
    *,
    towards: NDArray[np.float64] | None = None,
    progress: Progress | None = None,
) -> InPlaceRun:
    """Calibrate a closed sensor from its session folder.

    Parameters
    ----------
    session : Session
        Images and decisions of the user.
    towards : (terms, 2), optional
        Coefficients of an earlier calibration that these presses are to correct.
    progress : callable, optional
        Called with the stage name and the share done, 0..1.

    Raises
    ------
    InputError
        If background or balls are missing or cannot be used.
    """
    progress = progress or (lambda _stage, _share: None)
    _refuse_missing(session)
    files = tuple(path for stage in stages_of(session) for path in session.files(stage))
    refuse_copies(files)
    progress(tr("background"), 0.0)
    background = session.averaged("background")
    stated = session.in_place or InPlace()
    grid = stated_grid(stated, background.size)
    membrane = replace(background, rgb=grid.cut(background.rgb))
    require_colour(membrane, where=str(session.folder / "background"))
    scale = None if stated.mm_per_px is not None else measured_scale(session, stated, background)
    mm_per_px, scale_sd = _scale(stated, scale)
    grid = replace(grid, mm_per_px=mm_per_px)
    progress(tr("ball presses"), 0.05)
    presses, unreadable = _presses(session, background)
    result = calibrate_in_place(
        background.rgb,
        presses,
        grid,
        scale_sd=scale_sd,
        towards=towards,
        progress=lambda share: progress(tr("ball presses"), 0.05 + 0.95 * share),
    )
    result = replace(result, refused={**result.refused, **unreadable})
    calibration = InPlaceCalibration(
        sensor=ClosedSensor(session.serial),
        in_place=result.model,
        noise=_noise(membrane.rgb),
        balls=tuple(_ball_entry(press.name, press.ball, grid) for press in result.presses),
        quality=judge_in_place(result, scale_sd),
        provenance=provenance_of(session, files),
        response=session.response,
    )
    progress(tr("done"), 1.0)
    return InPlaceRun(calibration, result, scale)


def stages_of(session: Session) -> tuple[str, ...]:
    """Return the folders of the images that a calibration uses."""
    measured = session.in_place is not None and session.in_place.mm_per_px is None
    return (*CLOSED_STAGES, "scale") if measured else CLOSED_STAGES


def _refuse_missing(session: Session) -> None:
    """Refuse a session that lacks images, with all stages that do."""
    missing = [stage for stage in stages_of(session) if not session.found(stage)]
    if missing:
        raise InputError(
            tr("the session has no images of: {stages}").format(stages=", ".join(missing)),
            where=str(session.folder),
            advice=tr(
                "Capture the untouched membrane as background, and {n} or more presses of a ball "
                "of known radius at different places"
            ).format(n=ENOUGH_BALLS),
        )


def stated_grid(stated: InPlace, size: tuple[int, int]) -> WorkingGrid:
    """Return the grid of the images of a session; of scale 1 where that is to be measured.

    Parameters
    ----------
    stated : InPlace
        Scale and region.
    size : (width, height)
        Of the images.

    Raises
    ------
    InputError
        If the region is not in the image, or too small.
    """
    x, y = stated.mm_per_px or (1.0, 1.0)
    return WorkingGrid(ImageSize(*size), x, y / x, stated.region_px)


def measured_scale(session: Session, stated: InPlace, background: LinearImage) -> MeasuredScale:
    """Return the scale by the images of ``scale/``.

    Parameters
    ----------
    session : Session
        Its images.
    stated : InPlace
        The size of the pressed object.
    background : LinearImage
        The untouched membrane.

    Raises
    ------
    InputError
        If an image does not show the object.
    """
    images = session.images("scale")
    grid = stated_grid(stated, background.size)
    rgb, bare = [grid.cut(image.rgb) for image in images], grid.cut(background.rgb)
    where, pressed = str(session.folder / "scale"), stated.pressed_scale
    require_size(images[0].size, background.size, where=where)
    if pressed.pin_spacing_mm is not None:
        return scale_from_pins(
            rgb,
            bare,
            spacing_mm=pressed.pin_spacing_mm,
            where=where,
        )
    assert pressed.punch_diameter_mm is not None
    return scale_from_punch(
        rgb,
        bare,
        diameter_mm=pressed.punch_diameter_mm,
        where=where,
    )


def _scale(stated: InPlace, measured: MeasuredScale | None) -> tuple[float, float]:
    """Return the scale and its relative standard deviation."""
    if measured is not None:
        return measured.mm_per_px, measured.sd_mm_per_px / measured.mm_per_px
    assert stated.mm_per_px is not None
    mm_per_px, sd = stated.mm_per_px[0], stated.mm_per_px_sd
    return mm_per_px, STATED_SCALE_SD if sd is None else sd / mm_per_px


def _presses(
    session: Session, background: LinearImage
) -> tuple[list[PressImage], dict[str, InputError]]:
    """Return the ball images of the background's size, and why others cannot be used."""
    images, unreadable = session.usable_images("balls")
    presses = []
    for image in images:
        require_size(image.size, background.size, where=str(session.folder / "balls" / image.name))
        drawn = session.decisions.balls.get(image.name)
        placed = None if drawn is None else Circle(drawn.u_px, drawn.v_px, drawn.radius_px)
        radius_mm = session.ball_radius_mm(image.name)
        presses.append(PressImage(image.name, image.rgb, radius_mm, placed))
    if len(presses) < LEAST_PRESSES:
        raise InputError(
            tr("there are {n} ball images, {least} are needed").format(
                n=len(presses), least=LEAST_PRESSES
            ),
            where=str(session.folder / "balls"),
            advice=tr("Press a ball of known radius at {n} or more places").format(n=ENOUGH_BALLS),
        )
    return presses, unreadable


def _ball_entry(name: str, ball: Ball, grid: WorkingGrid) -> tuple[str, float, float, float, float]:
    return (
        as_text(name),
        float(grid.x_mm[0] + ball.x * grid.pitch_mm),
        float(grid.y_mm[0] + ball.y * grid.pitch_mm),
        ball.contact * grid.pitch_mm,
        ball.radius * grid.pitch_mm,
    )


def _noise(rgb: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the noise of a pixel (3,) from what a background shows beyond its neighbours."""
    fine = rgb - cv2.GaussianBlur(rgb, (0, 0), 1.0)
    spread = np.median(np.abs(fine - np.median(fine, axis=(0, 1))), axis=(0, 1))
    return np.asarray(1.4826 * spread, np.float64)


def judge_scale(mm_per_px: float, scale_sd: float, advice: str = "") -> QualityTable:
    """Judge a scale by its relative standard deviation; `advice` says how to lower it."""
    scale = judge("mm_per_px", tr("Scale"), mm_per_px, "mm/px")
    uncertainty = judge(
        "scale_sd_percent",
        tr("Uncertainty of the scale"),
        100.0 * scale_sd,
        "%",
        warn=2.0,
        fail=10.0,
        remedy=advice or tr("Measure the scale with a pin grid or a flat punch"),
    )
    return QualityTable((scale, uncertainty))


def judge_in_place(result: InPlaceResult, scale_sd: float) -> dict[str, QualityTable]:
    """Judge a calibration in place by the presses that were left out."""
    held_out = [press.held_out for press in result.presses]
    caps = np.array([press.cap_ratio for press in held_out])
    widths = np.array([press.diameter_ratio for press in held_out])
    caps, widths = caps[np.isfinite(caps)], widths[np.isfinite(widths)]
    used, refused = len(result.presses), len(result.refused)
    more = tr("Press more balls at more positions")
    sizes = tr("Check the ball radii and the scale (mm per pixel)")
    grid = result.model.grid
    scale = judge_scale(grid.mm_per_px, scale_sd).figures
    return {
        "scale": QualityTable((*scale, *judge_stretch(result.stretch, grid))),
        "balls": QualityTable(
            (
                judge(
                    "balls_used",
                    tr("Presses used"),
                    float(used),
                    warn=float(ENOUGH_BALLS),
                    higher_is_better=True,
                    remedy=more,
                ),
                judge(
                    "balls_left_out_percent",
                    tr("Presses left out"),
                    100.0 * refused / max(used + refused, 1),
                    "%",
                    warn=20.0,
                    fail=60.0,
                    remedy=tr("Check the background and the images that are named"),
                ),
                judge("steepest_slope_deg", tr("Steepest slope of the balls"),
                      float(np.degrees(np.arctan(result.model.steepest))), "deg"),
            )
        ),
        "in_place": QualityTable(
            (
                judge(
                    "held_out_normal_deg",
                    tr("Normals of presses left out, mean error"),
                    float(np.mean([press.normal_deg for press in held_out])),
                    "deg",
                    warn=5.0,
                    fail=12.0,
                    remedy=more,
                ),
                judge(
                    "held_out_cap_percent",
                    tr("Height of presses left out, typical error"),
                    100.0 * float(np.median(np.abs(caps - 1.0))) if caps.size else 100.0,
                    "%",
                    warn=8.0,
                    fail=25.0,
                    remedy=sizes,
                ),
                judge(
                    "held_out_diameter_percent",
                    tr("Ball diameter of presses left out, median error"),
                    100.0 * abs(float(np.median(widths)) - 1.0) if widths.size else 100.0,
                    "%",
                    warn=3.0,
                    fail=15.0,
                    remedy=sizes,
                ),
                *_learning_figures(result, more),
            )
        ),
    }  # fmt: skip


def _learning_figures(result: InPlaceResult, more: str) -> tuple[Finding, ...]:
    """Return the expected improvement by one more ball, from fits with fewer balls."""
    gain = expected_gain(result)
    if gain is None:
        return ()
    return (
        judge(
            "next_ball_gain_percent",
            tr("Smaller slope error by one more ball"),
            100.0 * gain,
            "%",
            warn=100.0 * SETTLED,
            remedy=more,
        ),
    )


def expected_gain(result: InPlaceResult) -> float | None:
    """Return the share by which one more ball is expected to make the slope error smaller.

    The error decreases as a power of the number of balls, to a limit that more balls do not
    improve.

    Parameters
    ----------
    result : InPlaceResult
        With its learning curve.

    Returns
    -------
    float or None
        None where there are too few balls to tell.
    """
    if len(result.learning) < 2:
        return None
    (fewer, before), (more, after) = result.learning[-2:]
    power = max(float(np.log(before / max(after, 1e-9)) / np.log(more / fewer)), 0.0)
    count = len(result.presses)
    return float(1.0 - (count / (count + 1.0)) ** power)


def with_background(
    calibration: InPlaceCalibration, background: LinearImage, *, operator: str, made: str
) -> InPlaceCalibration:
    """Return the calibration with another gel's background; slopes stay as they are.

    Its quality warns that no press of the new gel has been seen.

    Parameters
    ----------
    calibration : InPlaceCalibration
        Of the sensor with the gel before.
    background : LinearImage
        The new gel, untouched.
    operator, made : str
        Who did it and when, ISO 8601.

    Raises
    ------
    InputError
        If the image has another size.
    """
    camera = calibration.camera
    require_size(background.size, (camera.width, camera.height), where=background.name)
    model = calibration.in_place
    changed = replace(model, background=model.grid.reduce(background.rgb))
    edit = HandEdit("background", CHANNEL_KEYS, made, operator)
    provenance = replace(calibration.provenance, edits=(*calibration.provenance.edits, edit))
    unseen = judge(
        "presses_of_this_gel",
        tr("Presses of the present gel"),
        0.0,
        warn=1.0,
        higher_is_better=True,
        remedy=tr("Press a ball at three or more places and repair the calibration with them"),
    )
    quality = {**calibration.quality, "gel": QualityTable((unseen,))}
    return replace(calibration, in_place=changed, quality=quality, provenance=provenance)


def repaired(calibration: InPlaceCalibration, session: Session) -> InPlaceRun:
    """Return a calibration from the presses of a session, regularised towards an earlier one.

    Parameters
    ----------
    calibration : InPlaceCalibration
        Of the sensor with the gel before.
    session : Session
        Background and presses of the present gel, three or more.

    Raises
    ------
    InputError
        As :func:`~gelpolight_core.calibration.in_place_session.calibrate_closed_session`.
    """
    return calibrate_closed_session(session, towards=calibration.in_place.coefficients)
