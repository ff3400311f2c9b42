"""Computations of the stages of a closed sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    join_quality_tables,
    judge,
)
from gelpolight_core.base.robust import SD_OF_MEDIAN
from gelpolight_core.base.safe_reading import escape_undecodable
from gelpolight_core.calibration.closed_sensor.ball_contact import BallContact
from gelpolight_core.calibration.closed_sensor.contact_aspect import judge_stretch
from gelpolight_core.calibration.closed_sensor.pixel_scale import (
    MeasuredScale,
    judge_scale,
    scale_from_pins,
    scale_from_punch,
)
from gelpolight_core.calibration.closed_sensor.plausibility import judge_kind
from gelpolight_core.calibration.closed_sensor.preset import stated_sizes
from gelpolight_core.calibration.closed_sensor.press_light_change import BallImage
from gelpolight_core.calibration.closed_sensor.press_sizes import PressSize, press_sizes
from gelpolight_core.calibration.closed_sensor.slope_calibration import (
    BACKGROUND_ADVICE,
    InPlaceResult,
    calibrate_in_place,
    least_presses,
)
from gelpolight_core.health.global_change import LEAST_START
from gelpolight_core.image.linear_image import LinearImage, require_size
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL, UNKNOWN, ClosedSensor
from gelpolight_core.sensor.closed_sensor.slope_model import InPlaceModel
from gelpolight_core.sensor.closed_sensor.working_grid import ImageSize, WorkingGrid
from gelpolight_core.sensor.sensor_calibration import Calibration, ManualEdit, Provenance
from gelpolight_core.session.session import ClosedSensorSettings, Session
from gelpolight_core.stages.balls.contact_contour import ImageCircle

ENOUGH_BALLS = 8
SETTLED = 0.03
"""Gain of a further ball, relative to the error, below which more balls do not help."""
MORE_BALLS = "Press more balls at more positions"


@dataclass(frozen=True, slots=True)
class SlopesStageResult:
    """The slopes of a closed sensor's colours, from its ball presses.

    Attributes
    ----------
    result : InPlaceResult
        Presses, model and ridge.
    noise : (3,)
        Standard deviation of a pixel of a single image, per channel.
    sizes : tuple of PressSize
        The used press that contradicts the others most, and the sizes of presses left out.
    """

    result: InPlaceResult
    noise: NDArray[np.float64]
    sizes: tuple[PressSize, ...] = ()

    @property
    def tables(self) -> dict[str, QualityTable]:
        """The tables of figures by their keys."""
        return judge_in_place(self.result, self.sizes)

    @property
    def quality(self) -> QualityTable:
        """All figures."""
        return join_quality_tables(self.tables.values())

    @property
    def balls(self) -> tuple[tuple[str, float, float, float, float], ...]:
        """Name, x and y of the centre, contact radius and ball radius of each press, in mm."""
        grid = self.result.model.grid
        return tuple(_ball_entry(press.name, press.ball, grid) for press in self.result.presses)

    @property
    def lines(self) -> tuple[str, ...]:
        """The chosen model, its unknown quantities, and the presses that were left out."""
        result = self.result
        x, y = result.next_position_mm
        return (
            "model: in-place (closed sensor: background and balls only)",
            stated_sizes(
                (radius for *_, radius in self.balls),
                result.model.grid.pixel_mm.tolist(),
                (result.model.grid.image.width, result.model.grid.image.height),
            ),
            f"not known: {', '.join(UNKNOWN)}",
            (
                f"balls: {len(result.presses)} used, {len(result.refused)} left out; slopes seen "
                f"up to {np.degrees(np.arctan(result.model.steepest)):.0f} deg"
            ),
            *(f"left out: {fault}" for fault in result.refused.values()),
            f"another ball helps most at ({x:.1f}, {y:.1f}) mm",
        )

    @property
    def entries(self) -> dict[str, Any]:
        """The results as plain values, lengths in mm."""
        result, grid = self.result, self.result.model.grid
        return {
            "mm_per_px": grid.mm_per_px if grid.aspect == 1.0 else grid.pixel_mm.tolist(),
            "unknown": list(UNKNOWN),
            "steepest_slope": result.model.steepest,
            "balls": [
                {
                    "file": name,
                    "centre_mm": [x, y],
                    "contact_radius_mm": contact,
                    "radius_mm": radius,
                    "held_out_normal_deg": press.held_out.normal_deg,
                    "held_out_cap_ratio": _finite(press.held_out.cap_ratio),
                    "held_out_diameter_ratio": _finite(press.held_out.diameter_ratio),
                }
                for (name, x, y, contact, radius), press in zip(
                    self.balls, result.presses, strict=True
                )
            ],
            "left_out": {name: str(fault) for name, fault in result.refused.items()},
            "error_by_balls": [list(point) for point in result.learning],
            "next_ball_mm": list(result.next_position_mm),
        }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def find_slopes(
    session: Session,
    background: LinearImage,
    scale: MeasuredScale | None = None,
    *,
    towards: InPlaceModel | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> SlopesStageResult:
    """Find the slopes of a closed sensor's colours.

    Parameters
    ----------
    session : Session
        Ball presses, what is stated of the scale, and the decisions of the user.
    background : LinearImage
        The untouched membrane.
    scale : MeasuredScale, optional
        As measured; by default as stated.
    towards : InPlaceModel, optional
        An earlier calibration that these presses are to correct.
    progress : callable, optional
        Called with the share done, 0..1.

    Raises
    ------
    InputError
        If the images cannot be used.
    """
    in_place = session.in_place or ClosedSensorSettings()
    if scale is not None:
        sd_mm = scale.relative_sd * scale.mm_per_px[0]
        in_place = replace(in_place, mm_per_px=scale.mm_per_px, mm_per_px_sd=sd_mm)
    grid, sd = stated_grid(in_place, background.size), in_place.mm_per_px_sd
    grid = replace(grid, surface=session.surface)
    if scale is not None:
        grid = replace(grid, lens=scale.lens)
    # A scale that is stated without a standard deviation has 1 %.
    scale_sd = 0.01 if sd is None else sd / grid.mm_per_px
    presses, unreadable = _presses(session, background, least_presses(towards))
    noise = _noise(grid.cut(background.rgb))
    result = calibrate_in_place(
        background.rgb, presses, grid, noise, scale_sd=scale_sd, towards=towards, progress=progress
    )
    sizes, refused = press_sizes(presses, result, noise, towards), {**result.refused, **unreadable}
    for size in sizes:
        if size.remedy and (fault := refused.get(size.name)) is not None:
            text = f"{fault.found}; the other presses fit {size.proposed_mm:.3g} mm"
            refused[size.name] = InputError(text, size.name, Remedy.CHECK_RADIUS)
    return SlopesStageResult(replace(result, refused=refused), noise, sizes)


def in_place_calibration(
    session: Session, slopes: SlopesStageResult, quality: dict[str, QualityTable], made: Provenance
) -> Calibration:
    """Return the calibration of a closed sensor."""
    data = ClosedSensor(
        session.serial,
        in_place=slopes.result.model,
        noise=slopes.noise,
        balls=slopes.balls,
        response=session.response,
    )
    return Calibration(MODEL, data, quality, made)


def stated_grid(stated: ClosedSensorSettings, size: tuple[int, int]) -> WorkingGrid:
    """Return the grid of the images of a session. Its scale is 1 where that is to be measured.

    Parameters
    ----------
    stated : ClosedSensorSettings
        Scale and region.
    size : (width, height)
        Size of the images.

    Raises
    ------
    InputError
        If the region is not in the image, or too small.
    """
    x, y = stated.mm_per_px or (1.0, 1.0)
    return WorkingGrid(ImageSize(*size), x, y / x, stated.region_px)


def measured_scale(session: Session, background: LinearImage) -> MeasuredScale:
    """Return the scale by the images of ``scale/``.

    Parameters
    ----------
    session : Session
        Its images, and the size of the pressed object.
    background : LinearImage
        The untouched membrane.

    Raises
    ------
    InputError
        If an image does not show the object.
    """
    in_place = session.in_place or ClosedSensorSettings()
    pressed, grid = in_place.pressed_scale, stated_grid(in_place, background.size)
    images = session.images("scale")
    rgb, bare, where = (
        [image.rgb for image in images],
        background.rgb,
        str(session.folder / "scale"),
    )
    require_size(images[0].size, background.size, where=where)
    pins, punch = pressed.pin_spacing_mm, pressed.punch_diameter_mm
    if pins is not None:
        return scale_from_pins(rgb, bare, spacing_mm=pins, grid=grid, where=where)
    assert punch is not None
    return scale_from_punch(rgb, bare, diameter_mm=punch, grid=grid, where=where)


def _presses(
    session: Session, background: LinearImage, least: int
) -> tuple[list[BallImage], dict[str, InputError]]:
    """Return the ball images of the background's size, and the faults of the others."""
    images, unreadable = session.usable_images("balls")
    presses = []
    for image in images:
        require_size(image.size, background.size, where=str(session.folder / "balls" / image.name))
        drawn = session.decisions.balls.get(image.name)
        placed = None if drawn is None else ImageCircle(drawn.u_px, drawn.v_px, drawn.radius_px)
        radius_mm = session.ball_radius_mm(image.name)
        presses.append(BallImage(image.name, image.rgb, radius_mm, placed))
    if len(presses) < least:
        text = f"there are {len(presses)} ball images, {least} are needed"
        raise InputError(text, session.folder / "balls", Remedy.PRESS_BALLS)
    return presses, unreadable


def _ball_entry(
    name: str, ball: BallContact, grid: WorkingGrid
) -> tuple[str, float, float, float, float]:
    return (
        escape_undecodable(name),
        float(grid.x_mm[0] + ball.x * grid.pitch_mm),
        float(grid.y_mm[0] + ball.y * grid.pitch_mm),
        ball.contact * grid.pitch_mm,
        ball.radius * grid.pitch_mm,
    )


def _noise(rgb: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the noise of a pixel (3,) from what a background shows beyond its neighbours."""
    fine = rgb - cv2.GaussianBlur(rgb, (0, 0), 1.0)
    spread = np.median(np.abs(fine - np.median(fine, axis=(0, 1))), axis=(0, 1))
    return np.asarray(SD_OF_MEDIAN * spread, np.float64)


def judge_in_place(result: InPlaceResult, sizes: Sequence[PressSize]) -> dict[str, QualityTable]:
    """Judge an in-place calibration by the presses that were left out.

    Parameters
    ----------
    result : InPlaceResult
        The calibration.
    sizes : sequence of PressSize
        Sizes of presses; those of presses left out have no figure.
    """
    held_out = [press.held_out for press in result.presses]
    caps = np.array([press.cap_ratio for press in held_out])
    widths = np.array([press.diameter_ratio for press in held_out])
    caps, widths = caps[np.isfinite(caps)], widths[np.isfinite(widths)]
    used, refused = len(result.presses), len(result.refused)
    grid, kind = result.model.grid, judge_kind(result)
    helps = (
        Remedy.CHECK_SIZES
        if any(f.verdict is not Verdict.PASS for f in kind)
        else what_would_help(result)
    )
    scale = judge_scale(grid.pixel_mm.tolist(), result.model.scale_sd, grid.lens).figures
    return {
        "scale": QualityTable((*scale, *judge_stretch(result.stretch, grid))),
        "balls": QualityTable(
            (
                judge(
                    "balls_used",
                    "Presses used",
                    float(used),
                    warn=float(ENOUGH_BALLS),
                    higher_is_better=True,
                    remedy=MORE_BALLS,
                ),
                judge(
                    "background_share_percent",
                    "Membrane around the balls that looks like the background",
                    100.0 * result.as_background,
                    "%",
                    warn=100.0 * LEAST_START,
                    higher_is_better=True,
                    remedy=BACKGROUND_ADVICE,
                ),
                judge(
                    "balls_left_out_percent",
                    "Presses left out",
                    100.0 * refused / max(used + refused, 1),
                    "%",
                    warn=20.0,
                    fail=60.0,
                    remedy="Check the background and the images that are named",
                ),
                judge(
                    "steepest_slope_deg",
                    "Steepest slope of the balls",
                    float(np.degrees(np.arctan(result.model.steepest))),
                    "deg",
                ),
                *kind,
                *(size.figure for size in sizes if size.name not in result.refused),
            )
        ),
        "in_place": QualityTable(
            (
                judge(
                    "held_out_normal_deg",
                    "Normals of presses left out, mean error",
                    float(np.mean([press.normal_deg for press in held_out])),
                    "deg",
                    warn=5.0,
                    fail=12.0,
                    remedy=helps,
                ),
                judge(
                    "held_out_cap_percent",
                    "Height of presses left out, typical error",
                    100.0 * float(np.median(np.abs(caps - 1.0))) if caps.size else 100.0,
                    "%",
                    warn=8.0,
                    fail=25.0,
                    remedy=helps,
                ),
                judge(
                    "held_out_diameter_percent",
                    "Ball diameter of presses left out, median error",
                    100.0 * abs(float(np.median(widths)) - 1.0) if widths.size else 100.0,
                    "%",
                    warn=3.0,
                    fail=15.0,
                    remedy=helps,
                ),
                *_learning_figures(result),
            )
        ),
    }


def what_would_help(result: InPlaceResult) -> str:
    """Return what would make the errors of presses left out smaller, as a sentence.

    A wrong size of all balls changes slopes and balls alike: it does not show in these errors.
    """
    if not result.is_of_background:
        return BACKGROUND_ADVICE
    gain = expected_error_reduction(result)
    if gain is None or gain > SETTLED or len(result.presses) < ENOUGH_BALLS:
        return MORE_BALLS
    if result.has_markers:
        return "More balls do not help: markers hide the slope; larger balls hide less of it"
    if len({press.ball.radius for press in result.presses}) == 1:
        return "More balls of this size do not help: press balls of another size, too"
    return "More balls do not help: the stated uncertainty includes this error"


def _learning_figures(result: InPlaceResult) -> tuple[Finding, ...]:
    """Return the expected improvement by one more ball, from fits with fewer balls."""
    gain = expected_error_reduction(result)
    if gain is None:
        return ()
    return (
        judge(
            "next_ball_gain_percent",
            "Slope error that one more ball is expected to remove",
            100.0 * gain,
            "%",
            warn=100.0 * SETTLED,
            remedy=MORE_BALLS,
        ),
    )


def expected_error_reduction(result: InPlaceResult) -> float | None:
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
    calibration: Calibration, background: LinearImage, *, operator: str, made: str
) -> Calibration:
    """Return the calibration with another gel's background and the same slopes.

    Its quality warns that no press of the new gel has been seen.

    Parameters
    ----------
    calibration : Calibration
        Calibration with the earlier gel.
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
    data = calibration.data
    changed = data.with_background(data.on_grid(background.rgb))
    edit = ManualEdit("background", CHANNEL_KEYS, made, operator)
    provenance = replace(calibration.provenance, edits=(*calibration.provenance.edits, edit))
    unseen = judge(
        "presses_of_this_gel",
        "Presses of the present gel",
        0.0,
        warn=1.0,
        higher_is_better=True,
        remedy="Press a ball at eight or more places and repair the calibration with them",
    )
    quality = {**calibration.quality, "gel": QualityTable((unseen,))}
    return replace(calibration, data=changed, quality=quality, provenance=provenance)
