"""The last stage: LEDs and membrane refined on the ball presses, with their uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.ball_pixels import CoarseView, gather_ball_pixels
from gelpolight_core.calibration.board_reflectance import BesideBoard
from gelpolight_core.calibration.depth_scale import (
    ball_height_error,
    depth_scale_sd,
    lateral_scale_sd,
)
from gelpolight_core.calibration.joint import JointResult, refine_jointly
from gelpolight_core.calibration.results import StageResults, need
from gelpolight_core.calibration.saturated_background import beyond_saturation
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.masks import reflects_light
from gelpolight_core.reflectance.gathered_light import Slab
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.sensor_calibration import (
    Calibration,
    FullModel,
    Provenance,
    ScaleSd,
    sensor_stack,
)
from gelpolight_core.session.session import Session

CHECKED_BALLS = 4
GATHERED_SD = 0.005
"""Of the height, where light between parts of the membrane is gathered: what finite facets and
near windows change, besides the reflectance."""
LEAST_CONTACT_PX = 24.0
"""Median radius of the contacts from which on they show the balls' radii: within 0.5 % at 22 pixels
and more, but 8 % off at 18."""


def refine(session: Session, results: StageResults) -> StageResults:
    """Refine LEDs and membrane, and estimate the uncertainty of lengths.

    Parameters
    ----------
    session : Session
        Its ball images are reconstructed to check the result.
    results : StageResults
        Results of all earlier stages.

    Raises
    ------
    InputError
        If an earlier stage was not run.
    """
    table, lights = need(results.table, "balls"), need(results.lights, "balls")
    bare, factors = need(results.background, "balls"), need(results.factors, "balls")
    crosstalk = need(results.crosstalk, "balls").matrix
    background = unmix(bare, crosstalk)
    noise = press_noise(results.presses)
    view = CoarseView.of(table, reflects_light(table.valid, background))
    pixels = [
        gather_ball_pixels(
            press, unmix(image, crosstalk), background, table, view, factors.usable, noise
        )
        for press, image in zip(results.presses, results.images, strict=True)
    ]
    slab = Slab.of(sensor_stack(session.sensor, need(results.top_pose, "balls").plane))
    leds = lights.led_positions_mm
    radiance = need(results.radiance, "balls").radiance
    board = BesideBoard.of(table, factors.usable, background, radiance, crosstalk, leds)
    contacts_px = [press.indentation.contact_radius_px for press in results.presses]
    large = bool(contacts_px) and float(np.median(contacts_px)) >= LEAST_CONTACT_PX
    joint = refine_jointly(
        results.presses, pixels, leds, slab, background, board=board, check_radii=large
    )
    full = joint.full
    if full.kept == "mirror":
        variance = np.diagonal(lights.led_covariance_mm2, axis1=1, axis2=2)
        full = replace(full, led_sd_mm=np.sqrt(variance))
    lit, known = beyond_saturation(full, bare, factors.factors, crosstalk, table)
    full = replace(full, background=lit)
    refined = replace(results, factors=replace(factors, factors=known), joint=joint, full=full)
    scale = _scale_sd(session, refined, joint, full)
    return replace(refined, full=replace(full, scale_sd=scale))


def _scale_sd(
    session: Session, results: StageResults, joint: JointResult, full: FullModel
) -> ScaleSd:
    """Estimate the uncertainty of lengths of the full model."""
    calibration = bare_calibration(session, replace(results, full=full))
    lens, pose = need(results.lens, "balls"), need(results.top_pose, "balls")
    covariance = joint.covariance.copy()
    if full.kept == "mirror":
        for k, own in enumerate(calibration.led_covariance_mm2):
            covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = own
    files = [ball.file for ball in results.balls if ball.press is not None]
    # Evenly over the session, so that a single odd press does not decide.
    some = np.unique(np.linspace(0, len(files) - 1, CHECKED_BALLS).round().astype(int)).tolist()
    unexplained = ball_height_error(
        calibration,
        [session.image(session.folder / "balls" / files[i]).rgb for i in some],
        [joint.balls[i] for i in some],
    )
    lateral = lateral_scale_sd(
        calibration.stack, pose.distance_sd_mm, lens.focal_sd_px[0] / lens.camera.fx
    )
    fitted = depth_scale_sd(full, calibration.table, covariance)
    gathered = GATHERED_SD if full.membrane.interreflection > 0.0 else 0.0
    together = float(np.linalg.norm([fitted, unexplained, lateral, gathered]))
    return ScaleSd(together, lateral, unexplained)


def bare_calibration(session: Session, results: StageResults) -> Calibration:
    """Return what a reconstruction needs of the results, without figures and provenance.

    Parameters
    ----------
    session : Session
        With the stated sensor data.
    results : StageResults
        Results of all stages; without the joint refinement the calibration is for the paper's
        model.

    Raises
    ------
    InputError
        If a stage was not run.
    """
    where = str(session.folder)
    lens, pose = need(results.lens, where), need(results.top_pose, where)
    lights, radiance = need(results.lights, where), need(results.radiance, where)
    return Calibration(
        sensor=session.sensor,
        model="paper" if results.full is None else "full",
        camera=lens.camera,
        plane=pose.plane,
        led_positions_mm=lights.led_positions_mm,
        led_covariance_mm2=lights.led_covariance_mm2,
        crosstalk=need(results.crosstalk, where).matrix,
        radiance=radiance.radiance,
        factors=need(results.factors, where).factors,
        reflectance=need(results.reflectance, where).table,
        noise=press_noise(results.presses),
        quality={},
        provenance=Provenance("", "", "", "", {}),
        full=results.full,
        response=need(results.response, where).response,
        bad=results.bad if results.bad is not None and results.bad.pixels.size else None,
        lens_blur_px=pose.blur_px,
    )


def press_noise(presses: tuple[BallPress, ...]) -> NDArray[np.float64]:
    """Return the noise of press minus background, per channel, over all presses."""
    return np.asarray(np.mean([p.indentation.noise for p in presses], axis=0), np.float64)
