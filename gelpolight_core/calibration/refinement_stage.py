"""The last stage: LEDs and membrane refined on the ball presses, with their uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from gelpolight_core.base.finding import Finding, QualityTable, Verdict, judge
from gelpolight_core.base.membrane_masks import reflects_light
from gelpolight_core.geometry.length_tolerances import HEIGHT_BY_RADIUS, SHOWN_SD
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.geometry.refraction import LayerStack
from gelpolight_core.geometry.resampling import build_resampling_table
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.parameter import PriorSource
from gelpolight_core.reconstruction.frame_checks import STRONG_FEEDBACK
from gelpolight_core.sensor.sensor_calibration import (
    FullModel,
    OpenSensor,
    ScaleUncertainty,
    sensor_stack,
)
from gelpolight_core.session.session import SensorData, Session
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES
from gelpolight_core.stages.leds.crosstalk import unmix
from gelpolight_core.stages.leds.setup_checks import LEAST_INDEX

from .ball_pixels import CoarseRayGrid, gather_ball_pixels
from .board_light import GATHERED_SHARE, BoardLight
from .conditioning import judge_determined
from .depth_scale import (
    PressCheck,
    check_presses,
    height_gradient,
    lateral_scale_sd,
    light_feedback,
)
from .height_limits import FAIL_PERCENT, WARN_PERCENT
from .joint_refinement import CLEAR, JointRefinement, StatedLengthFit, refine_jointly
from .open_ball_stages import BALLS, REFLECTANCE
from .open_sensor_recipe import (
    BACKGROUND,
    LENS,
    LIGHTS,
    RADIANCE,
    RESPONSE,
    TOP_POSE,
    with_response,
)
from .recipe import StageContext, StageResults
from .refinement_parameters import INTERREFLECTION, RISE_SD_MM
from .refinement_problem import LATERAL, RISE_SHARE, STATED
from .saturated_background import fill_saturated_background

UNEXPLAINED = (
    "The light model lacks something: capture the presses again, on a clean membrane and without"
    " compression (PNG)"
)
"""Where no stated length explains what is left."""
BOARD_SDS = 2.0
"""Difference between white board and presses, from which on one of both is wrong."""
SURE_SDS = 5.0
"""Standard deviations of a mould's tolerance that no mould is off."""
LEAST_CONTACT_PX = 24.0
"""Median radius of the contacts from which on they show the balls' radii: within 0.5 % at 22 pixels
and more, but 8 % off at 18."""


@dataclass(frozen=True, slots=True)
class RefinementStageResult:
    """Result of the refinement stage: refined model, reflectance factors and findings.

    Attributes
    ----------
    refined : JointRefinement
        LEDs, membrane and balls that fit all presses together.
    full : FullModel
        With the background filled in where it is saturated, and the uncertainty of lengths.
    factors : (rows, columns, 3) float32
        Reflectance factors, filled in the same way.
    findings : tuple of Finding
        About what is stated of the sensor, and how well its parameters are determined.
    checked : PressCheck or None
        The presses, reconstructed.
    """

    refined: JointRefinement
    full: FullModel
    factors: NDArray[np.float32]
    findings: tuple[Finding, ...] = ()
    checked: PressCheck | None = None

    @property
    def quality(self) -> QualityTable:
        """Figures of the refinement."""
        return judge_joint(self.refined, self.full, self.findings)


def refine(work: StageContext) -> RefinementStageResult:
    """Refine LEDs and membrane, and estimate the uncertainty of lengths.

    Some ball images are reconstructed to check the result.
    """
    session, results = with_response(work.session, work.results), work.results
    top, lights, balls = results[TOP_POSE], results[LIGHTS], results[BALLS]
    untouched, factors = results[BACKGROUND], results[REFLECTANCE].factors
    table, bare, crosstalk = untouched.table, untouched.light, lights.crosstalk.matrix
    background, leds_mm = unmix(bare, crosstalk), lights.leds.led_positions_mm
    noise = press_noise(balls.presses)
    view = CoarseRayGrid.of(table, reflects_light(table.valid, background))
    pixels = [
        gather_ball_pixels(
            press, unmix(image, crosstalk), background, table, view, factors.usable, noise
        )
        for press, image in zip(balls.presses, balls.images, strict=True)
    ]
    stack = sensor_stack(session.sensor, top.pose.plane)
    slab = Slab.of(stack)
    board = None
    if RADIANCE.used(session):
        radiance = untouched.radiance.radiance
        board = BoardLight.from_images(
            table,
            factors.usable,
            background,
            radiance,
            crosstalk,
            leds_mm,
            view,
            slab,
            session.sensor.elastomer_thickness_mm,
            session.board_reflectance,
        )
        unmeasured = lights.crosstalk.quality["crosstalk_unmeasured"].value
        board = replace(board, separated=unmeasured == 0.0)
    contacts_px = [press.indentation.contact_radius_px for press in balls.presses]
    large = bool(contacts_px) and float(np.median(contacts_px)) >= LEAST_CONTACT_PX
    bright_mm = lights.leds.bright_points_mm if large else None
    joint = refine_jointly(
        balls.presses,
        pixels,
        leds_mm,
        slab,
        background,
        board=board,
        half_angle_deg=session.sensor.led_half_angle_deg,
        bright_mm=bright_mm,
    )
    full = joint.full
    if full.kept == "mirror":
        variance = np.diagonal(lights.leds.led_covariance_mm2, axis1=1, axis2=2)
        full = replace(full, led_sd_mm=np.sqrt(variance))
    if joint.surface != table.surface:
        width_mm = session.sensor.working_diameter_mm
        table = build_resampling_table(
            results[LENS].camera,
            top.pose.plane,
            stack,
            working_diameter_mm=width_mm,
            surface=joint.surface,
        )
        bare = table.apply(untouched.bad.fill_bad_pixels(session.averaged(BACKGROUND.folder).rgb))
        full = replace(full, background=unmix(bare, crosstalk))
    filled_light, filled_factors = fill_saturated_background(
        full, bare, factors.factors, crosstalk, table
    )
    field_mm = float(np.ptp(view.points_mm[:, 0]))
    stated_findings = judge_stated_lengths(joint.stated, session.sensor, stack, field_mm)
    result = RefinementStageResult(
        joint, replace(full, background=filled_light), filled_factors, stated_findings
    )
    scale_sd, determined, checked = _uncertainty(session, results, result)
    full = replace(result.full, scale_sd=scale_sd)
    return replace(result, full=full, findings=(*stated_findings, *determined), checked=checked)


def _uncertainty(
    session: Session, results: StageResults, result: RefinementStageResult
) -> tuple[ScaleUncertainty, tuple[Finding, ...], PressCheck]:
    """Estimate the uncertainty of lengths of the full model, and judge what determines it."""
    full, joint = result.full, result.refined
    calibration = sensor_data(session, results, result)
    lens, pose = results[LENS], results[TOP_POSE].pose
    covariance = joint.covariance.copy()
    if full.kept == "mirror":
        leds = np.arange(calibration.led_positions_mm.size)  # the LEDs come first
        covariance[np.ix_(leds, leds)] = block_diag(*calibration.led_covariance_mm2)
    seen = [ball for ball in results[BALLS].seen if ball.press is not None]
    checked = check_presses(
        calibration,
        (session.image(session.folder / BALLS.folder / ball.file).rgb for ball in seen),
        [ball.light.gain for ball in seen],
        joint.balls,
    )
    unexplained = checked.height_error
    factor_by_key = {one.key: one.value for one in joint.stated}
    # What presses ask for is not corrected, and remains an error itself.
    asked = [k for k, one in joint.evidence.items() if one.used and k in LATERAL]
    focal_sd = float(lens.sd[0]) / lens.camera.fx
    seen_sd = lateral_scale_sd(calibration.stack, pose.distance_sd_mm, focal_sd)
    lateral = float(np.linalg.norm([seen_sd, *(factor_by_key[key] - 1.0 for key in asked)]))
    for k, (parameter, value) in enumerate(zip(joint.shared, joint.shared_values, strict=True)):
        if parameter.key == INTERREFLECTION.key:
            # Deep walls receive more of it than balls show, and what is missing in the model shows
            # as a difference to the white board.
            covariance[k, k] += (GATHERED_SHARE * value) ** 2 + _board_difference(joint)[0] ** 2
    gradient = height_gradient(
        full, calibration.table, joint.shared, joint.shared_values, covariance
    )
    fitted = float(np.sqrt(gradient @ covariance @ gradient))
    together = float(np.linalg.norm([fitted, unexplained, lateral]))
    radius_shift = None
    if factor_by_key:
        radius_shift = (factor_by_key["radius"] - 1.0, SHOWN_SD / float(np.sqrt(len(joint.balls))))
    determined = judge_determined(joint.determined, joint.shared, covariance, gradient)
    determined += _feedback(light_feedback(full, calibration.table))
    return ScaleUncertainty(together, lateral, unexplained, radius_shift), determined, checked


def _feedback(gain: float) -> tuple[Finding, ...]:
    """Return the finding on light between walls, where there is any."""
    if not gain:
        return ()
    return (
        judge(
            "light_feedback",
            "Share of an error of interreflected light that comes back at walls",
            100.0 * gain,
            "%",
            warn=100.0 * STRONG_FEEDBACK,
            remedy="Deep presses multiply small errors here: press less deep, "
            "or use a membrane that reflects less",
        ),
    )


def _board_difference(joint: JointRefinement) -> tuple[float, float]:
    """Return reflectance by the presses less that by the white board, in its unit and in sd.

    Both are 0 without a white board, and without interreflected light.
    """
    for parameter, value in zip(joint.shared, joint.shared_values.tolist(), strict=True):
        prior = parameter.prior
        if parameter.key != INTERREFLECTION.key or prior is None or prior.mean is None:
            continue
        if prior.source is PriorSource.WHITE_BOARD:
            return value - prior.mean, (value - prior.mean) / prior.sd
    return 0.0, 0.0


def press_noise(presses: Sequence[BallPress]) -> NDArray[np.float64]:
    """Return the noise of press minus background, per channel, over all presses."""
    return np.asarray(np.mean([p.indentation.noise for p in presses], axis=0), np.float64)


def sensor_data(
    session: Session, results: StageResults, joint: RefinementStageResult | None = None
) -> OpenSensor:
    """Return what a reconstruction needs of the results.

    Parameters
    ----------
    session : Session
        With the stated sensor data.
    results : StageResults
        Results of the stages up to the reflectance.
    joint : RefinementStageResult, optional
        Result of the full model. Without it the calibration is for the paper's model.

    Raises
    ------
    InputError
        If a stage was not run.
    """
    lens, pose, lights = results[LENS], results[TOP_POSE].pose, results[LIGHTS]
    reflectance, bad = results[REFLECTANCE], results[BACKGROUND].bad
    surface = results[BACKGROUND].table.surface if joint is None else joint.refined.surface
    return OpenSensor(
        sensor=session.sensor,
        camera=lens.camera,
        plane=pose.plane,
        led_positions_mm=lights.leds.led_positions_mm,
        led_covariance_mm2=lights.leds.led_covariance_mm2,
        crosstalk=lights.crosstalk.matrix,
        radiance=results[BACKGROUND].radiance.radiance,
        factors=reflectance.factors.factors if joint is None else joint.factors,
        reflectance=reflectance.table.table,
        noise=press_noise(results[BALLS].presses),
        full=None if joint is None else joint.full,
        response=results[RESPONSE].response,
        bad=bad if bad.pixels.size else None,
        lens_blur_px=pose.blur_px,
        shape=None if surface.flat else surface,
    )


def judge_joint(
    joint: JointRefinement, full: FullModel, findings: tuple[Finding, ...] = ()
) -> QualityTable:
    """Judge the joint refinement."""
    return QualityTable(
        (
            judge(
                "joint_misfit_percent",
                "Unexplained signal of ball presses and drapes",
                100.0 * full.misfit,
                "%",
                warn=4.0,
                remedy=UNEXPLAINED,
            ),
            judge(
                "joint_led_sd_mm",
                "LED position after refinement, standard deviation",
                float(np.linalg.norm(full.led_sd_mm, axis=1).max()),
                "mm",
                # LEDs from the mirror have the tolerance of the housing.
                warn=0.2 if full.kept == "refined" else None,
                remedy="Press more balls at more positions",
            ),
            *_judge_board(joint),
            *_judge_shape(joint.surface),
            *judge_presses(joint),
            *findings,
            *_scale_figures(full, findings),
            *_judge_parameters(joint),
        )
    )


def _judge_parameters(joint: JointRefinement) -> Iterator[Finding]:
    """Judge the values of the parameters that declare a figure."""
    for parameter, value in zip(joint.shared, joint.shared_values.tolist(), strict=True):
        if parameter.figure:
            yield judge(
                parameter.full_key, parameter.figure, value, parameter.unit, warn=parameter.warn
            )


def _judge_board(joint: JointRefinement) -> tuple[Finding, ...]:
    """Judge the membrane's reflectance by the presses against that by the white board."""
    difference, sds = _board_difference(joint)
    if sds == 0.0:
        return ()
    return (
        judge(
            "interreflection_sd",
            (
                "Reflectance of the membrane by presses less that by the white board"
                f" ({difference:+.2f}), in standard deviations"
            ),
            abs(sds),
            warn=BOARD_SDS,
            remedy=(
                "The light model lacks something, or the white board is not white: state its"
                " reflectance in session.toml, and capture whiteboard and background with one"
                " exposure"
            ),
        ),
    )


def _judge_shape(surface: MembraneShape) -> tuple[Finding, ...]:
    """Judge the height of a curved membrane against the stated one."""
    if surface.flat:
        return ()
    height_mm = surface.apex_height_mm + surface.rise_mm
    text = f"Height of the membrane against the stated one ({height_mm:.2f} mm fits)"
    if surface.apex_height_mm == 0.0:
        text = f"The membrane is not flat, as it is stated ({height_mm:.2f} mm high fits)"
    return (
        judge(
            "membrane_height_mm",
            text,
            abs(surface.rise_mm),
            "mm",
            warn=2.0 * RISE_SD_MM,
            fail=SURE_SDS * RISE_SD_MM,
            remedy="The membrane has another shape: correct [membrane] in session.toml",
        ),
    )


def judge_presses(joint: JointRefinement) -> tuple[Finding, ...]:
    """Judge the ball press with the largest residual, compared with the others.

    Parameters
    ----------
    joint : JointRefinement
        Fewer than four presses say nothing of each other.
    """
    # A press without any usable pixel has no misfit.
    misfits = joint.ball_misfits
    if np.isfinite(misfits).sum() < LEAST_PRESSES:
        return ()
    worst = joint.ball_names[int(np.nanargmax(misfits))]
    return (
        judge(
            "worst_press_ratio",
            f"Unexplained signal of the worst press over the usual ({worst})",
            float(np.nanmax(misfits) / np.nanmedian(misfits)),
            warn=2.0,
            remedy=f"Check the stated diameter of {worst}; clean the membrane and repeat the press",
        ),
    )


def judge_stated_lengths(
    stated: Sequence[StatedLengthFit], sensor: SensorData, stack: LayerStack, field_mm: float
) -> tuple[Finding, ...]:
    """Judge what is stated of a sensor by its ball presses.

    Parameters
    ----------
    stated : sequence of StatedLengthFit
        What contradicts the presses, the most likely first.
    sensor, stack
        As stated, and the layers that follow from it.
    field_mm : float
        Width of the visible field.
    """
    if not stated:
        return ()
    best = stated[0]
    apparent_mm = sum(t / n for t, n in zip(stack.thicknesses_mm, stack.indices, strict=True))
    texts = {
        "radius": "the ball diameters ({x:.3f} times the stated ones fit)",
        "square": "the squares of the board on the top surface ({x:.3f} times the stated fit)",
        "led_height": "the LED height ({height:.1f} mm fits)",
        "response": "the camera's response, which is not as declared (an exponent of {x:.2f} fits)",
        "membrane": "the membrane, which is not flat (a cap {cap:.1f} mm high fits)",
        "contrast": (
            "temporal noise reduction of the camera: presses have {x:.2f} of their contrast, as if"
            " it blends in the frame before"
        ),
        "layers": (
            "thickness and refractive index of the layers ({gel:+.1f} mm of elastomer or"
            " {window:+.1f} mm of window fit)"
        ),
    }
    gel, window = (
        1.0 / (1.0 - 1.0 / max(index, LEAST_INDEX))
        for index in (sensor.elastomer_refractive_index, sensor.window_refractive_index)
    )
    ball = "the diameter of the ball in {name} ({x:.3f} times the stated one fits)"
    suspects = [
        texts.get(one.key, ball).format(
            name=one.key.removeprefix("ball "),
            x=one.value,
            height=one.value * sensor.led_height_mm,
            gel=(1.0 - one.value) * apparent_mm * gel,
            window=(1.0 - one.value) * apparent_mm * window,
            cap=(one.value - 1.0) * RISE_SHARE * sensor.working_diameter_mm**2 / field_mm,
        )
        for one in stated
        # What the first one does not clearly beat is as likely, if it is not as stated.
        if one is best or (one.unlikely <= best.unlikely + CLEAR and abs(one.value - 1.0) > one.sd)
    ]
    shown_percent = 100.0 * best.sd * (2.0 if best.asked else float(np.sqrt(CLEAR)))
    return (
        judge(
            "stated_percent",
            "What is stated of the sensor against the ball presses, worst",
            100.0 * abs(best.value - 1.0),
            "%",
            warn=shown_percent,
            # What is within its deviation is not wrong, however large that is; one ball of many
            # changes no height.
            fail=(
                max(FAIL_PERCENT / HEIGHT_BY_RADIUS, shown_percent) if best.key in STATED else None
            ),
            remedy=f"Check {' or '.join(suspects)}",
        ),
    )


def _scale_figures(full: FullModel, findings: Sequence[Finding]) -> tuple[Finding, ...]:
    scale = full.scale_sd
    if scale is None:
        return ()
    remedy = "Check the ball diameters, the LED height and the refractive index"
    if any(f.key == "stated_percent" and f.verdict is Verdict.PASS for f in findings):
        remedy = UNEXPLAINED
    stated_wrong = scale.balls**2 > 0.5 * scale.depth**2
    return (
        judge(
            "ball_height_error_percent",
            "Height error of reconstructed ball presses",
            100.0 * scale.balls,
            "%",
            warn=WARN_PERCENT,
            fail=FAIL_PERCENT,
            remedy=remedy,
        ),
        judge(
            "depth_sd_percent",
            "Height uncertainty from the calibration",
            100.0 * scale.depth,
            "%",
            warn=WARN_PERCENT,
            fail=FAIL_PERCENT,
            # More balls reduce scatter, but not an error common to all heights.
            remedy=remedy if stated_wrong else "Press more balls at more positions",
        ),
    )
