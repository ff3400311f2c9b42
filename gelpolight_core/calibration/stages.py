"""The stages of a calibration: the inputs of each, and one function that runs it.

The command line runs all stages in order. The desktop program runs each stage as soon as its inputs
are available, keeps the results, and repeats only stages that a new image or decision has made out
of date. Both call :func:`run_stage` and therefore give the same numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import find_bad_pixels, no_bad_pixels
from gelpolight_core.calibration.inputs import NEEDS, Stage, inputs_of
from gelpolight_core.calibration.refinement import refine
from gelpolight_core.calibration.results import (
    SeenBall,
    StageResults,
    judge_bad_pixels,
    need,
)
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import calibrate_factors
from gelpolight_core.factors.bare_membrane import check_bare_membrane
from gelpolight_core.finding import QualityTable
from gelpolight_core.image.linear import LinearImage, require_size
from gelpolight_core.lights.crosstalk import find_crosstalk, unmix
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.lights.positions import locate_leds
from gelpolight_core.masks import saturated
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.lens import LensResult, calibrate_lens
from gelpolight_core.optics.pose import estimate_top_pose
from gelpolight_core.optics.refraction import LayerStack, camera_to_membrane
from gelpolight_core.optics.resampling import build_resampling_table
from gelpolight_core.parallel import in_parallel
from gelpolight_core.radiance.whiteboard import calibrate_radiance
from gelpolight_core.reflectance.press import PlacedContact, find_ball
from gelpolight_core.reflectance.stage import calibrate_reflectance
from gelpolight_core.response.stage import declare_response, measure_response
from gelpolight_core.sensor_calibration import (
    sensor_stack,
)
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.session.images import require_colour
from gelpolight_core.session.session import Session
from gelpolight_core.set_up import judge_set_up, judge_set_up_by_pose
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
Progress = Callable[[float], None]


def run_stage(
    stage: Stage, session: Session, results: StageResults, *, progress: Progress | None = None
) -> StageResults:
    """Run one stage on the results of the earlier ones.

    Parameters
    ----------
    stage : Stage
        The stage.
    session : Session
        Images and decisions.
    results : StageResults
        Results of all stages that this one needs; balls found earlier are reused if their inputs
        have not changed.
    progress : callable, optional
        Called with the share of this stage done, 0..1.

    Returns
    -------
    StageResults
        Including this stage's result.

    Raises
    ------
    InputError
        If the stage's images are missing or cannot be used. In a stage of several captures
        (checkerboard, top_pose, balls) a capture that cannot be used is left out with its reason;
        the stage is refused only if too few are left.
    """
    if results.response is not None:
        session = replace(session, response=results.response.response)
    return _RUNS[stage](session, results, progress or (lambda _share: None))


def _run_response(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    if "response" in session.optional_stages:
        response = measure_response(*session.series(), declared=session.declared_response)
    else:
        response = declare_response(session.declared_response)
    return replace(results, response=response)


def _run_lens(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    images, refused = session.usable_images("checkerboard")
    lens = calibrate_lens(images, session.checkerboard, refused=refused)
    return replace(results, lens=lens)


def _run_top_pose(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    lens = need(results.lens, "top_pose")
    images, refused = session.usable_images("top_pose")
    pose = estimate_top_pose(
        images,
        session.top_pose,
        lens.camera,
        focal_sd_px=lens.focal_sd_px[0],
        refused=refused,
    )
    table = build_resampling_table(
        lens.camera,
        pose.plane,
        sensor_stack(session.sensor, pose.plane),
        working_diameter_mm=session.sensor.working_diameter_mm,
    )
    return replace(results, top_pose=pose, table=table)


def _run_lights(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    lens, pose = need(results.lens, "mirror"), need(results.top_pose, "mirror")
    spots = find_mirror_spots(
        _stage_image(session, "mirror", lens), placed=session.decisions.spots_px
    )
    lights = locate_leds(
        spots,
        lens.camera,
        pose.plane,
        led_height_mm=session.sensor.led_height_mm,
        plane_distance_sd_mm=pose.distance_sd_mm,
        plane_normal_sd_rad=float(np.radians(pose.normal_sd_deg)),
    )
    poor = (
        *judge_set_up(session.sensor),
        *judge_set_up_by_pose(session.sensor, lens.camera, pose.plane, lights.led_positions_mm),
    )
    lights = replace(lights, quality=QualityTable((*lights.quality.figures, *poor)))
    crosstalk = find_crosstalk(spots, _single_led(session, lens))
    return replace(results, lights=lights, crosstalk=crosstalk)


def _single_led(session: Session, lens: LensResult) -> tuple[LinearImage, ...]:
    if "single_led" not in session.optional_stages:
        return ()
    images = session.single_led()
    for image in images:
        require_colour(image, where=f"single_led/{image.name}")
    _same_size(images[0], lens, "single_led")
    return images


def _run_radiance(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    lens, table = need(results.lens, "whiteboard"), need(results.table, "whiteboard")
    lights = need(results.lights, "whiteboard")
    whiteboard = _stage_image(session, "whiteboard", lens)
    return replace(results, radiance=calibrate_radiance(whiteboard, table, lights.led_positions_mm))


def _run_background(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    lens, table = need(results.lens, "background"), need(results.table, "background")
    background = _stage_image(session, "background", lens)
    _refuse_unlit(background)
    # As encoded by the camera, like the live hint.
    raw = replace(session, response=None)
    whiteboard = raw.averaged("whiteboard").rgb if session.found("whiteboard") else None
    seen = check_bare_membrane(raw.averaged("background").rgb, table=table, whiteboard=whiteboard)
    bad = no_bad_pixels(*background.rgb.shape[:2])
    if whiteboard is not None and whiteboard.shape == background.rgb.shape:
        scenes = [background.rgb, session.averaged("whiteboard").rgb]
        bad = find_bad_pixels(scenes, noise=0.0)
    return replace(
        results,
        background=table.apply(bad.left_out(background.rgb)),
        bare_membrane=QualityTable((*seen.quality.figures, judge_bad_pixels(bad))),
        bad=bad,
    )


def _run_balls(session: Session, results: StageResults, progress: Progress) -> StageResults:
    known = {ball.key: ball for ball in results.balls}
    inputs = inputs_of(session)
    rests_on = tuple(inputs[need].fingerprint for need in NEEDS[Stage.BALLS])
    hashes = dict(inputs[Stage.BALLS].images)
    # A press captured at this moment belongs to the next computation.
    files = [path for path in session.files("balls") if path.name in hashes]
    bare = unmix(need(results.background, "balls"), need(results.crosstalk, "balls").matrix)

    def ball(path: Path) -> SeenBall:
        key = _ball_key(path.name, session, (*rests_on, hashes[path.name]))
        return known[key] if key in known else _find_ball(path, key, session, results, bare)

    balls: list[SeenBall] = []
    with closing(in_parallel(ball, files)) as seen:
        for found in seen:
            progress(len(balls) / len(files))
            balls.append(found)
    return replace(results, balls=tuple(balls))


def _ball_key(name: str, session: Session, rests_on: tuple[str, ...]) -> str:
    stated = (name, session.ball_radius_mm(name), session.decisions.balls.get(name))
    return hashlib.sha256(repr((rests_on, stated)).encode()).hexdigest()


def _find_ball(
    path: Path, key: str, session: Session, results: StageResults, bare: Map
) -> SeenBall:
    lens, table = need(results.lens, "balls"), need(results.table, "balls")
    lights, radiance = need(results.lights, "balls"), need(results.radiance, "balls")
    crosstalk = need(results.crosstalk, "balls").matrix
    radius = session.ball_radius_mm(path.name)
    pose = need(results.top_pose, "balls")
    stack = sensor_stack(session.sensor, pose.plane)
    placed = session.decisions.balls.get(path.name)
    try:
        image = session.image(path)
        require_colour(image, where=str(path))
        _same_size(image, lens, "balls")
        seen = table.apply(need(results.bad, "balls").left_out(image.rgb))
        contact = None
        if placed is not None:
            contact = placed_contact(placed, lens.camera, pose.plane, stack)
        press = find_ball(
            unmix(seen, crosstalk),
            bare,
            table,
            lights.led_positions_mm,
            radius_mm=radius,
            name=f"balls/{path.name}",
            usable=radiance.usable,
            placed=contact,
        )
    except InputError as fault:
        return SeenBall(path.name, key, None, None, fault)
    return SeenBall(path.name, key, seen, press, None)


def placed_contact(
    circle: PlacedCircle, camera: Camera, plane: TopPlane, stack: LayerStack
) -> PlacedContact:
    """Return the circle on the undeformed membrane for a circle set in the raw image.

    Raises
    ------
    InputError
        If it extends beyond the visible part of the membrane.
    """
    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    u = circle.u_px + circle.radius_px * np.cos(turns)
    v = circle.v_px + circle.radius_px * np.sin(turns)
    edge_mm, _ = camera_to_membrane(camera.directions(np.stack([u, v], axis=-1)), plane, stack)
    if not np.isfinite(edge_mm).all():
        raise InputError(
            tr("The circle set by hand extends beyond the visible membrane"),
            where=tr("balls"),
            advice=tr("Move it inside the working area, or exclude the image"),
        )
    middle = edge_mm.mean(axis=0)
    radius_mm = float(np.hypot(*(edge_mm - middle).T).mean())
    return PlacedContact((float(middle[0]), float(middle[1])), radius_mm)


def _run_reflectance(session: Session, results: StageResults, _progress: Progress) -> StageResults:
    """Fit the table, then the factors, and feed these back once (section V-E)."""
    del session
    table, lights = need(results.table, "balls"), need(results.lights, "balls")
    radiance, bare = need(results.radiance, "balls"), need(results.background, "balls")
    leds, presses, images = lights.led_positions_mm, results.presses, results.images
    first = calibrate_reflectance(presses, images, table, leds, radiance)
    factors = calibrate_factors(bare, table, leds, radiance, first.table)
    second = calibrate_reflectance(presses, images, table, leds, radiance, factors.factors)
    factors = calibrate_factors(bare, table, leds, radiance, second.table)
    return replace(results, reflectance=second, factors=factors)


_RUNS: Mapping[Stage, Callable[[Session, StageResults, Progress], StageResults]] = MappingProxyType(
    {
        Stage.RESPONSE: _run_response,
        Stage.LENS: _run_lens,
        Stage.TOP_POSE: _run_top_pose,
        Stage.LIGHTS: _run_lights,
        Stage.RADIANCE: _run_radiance,
        Stage.BACKGROUND: _run_background,
        Stage.BALLS: _run_balls,
        Stage.REFLECTANCE: _run_reflectance,
        Stage.JOINT: lambda session, results, _progress: refine(session, results),
    }
)


def _stage_image(session: Session, stage: str, lens: LensResult) -> LinearImage:
    image = session.averaged(stage)
    require_colour(image, where=f"{stage}/{image.name}")
    _same_size(image, lens, stage)
    return image


def _same_size(image: LinearImage, lens: LensResult, stage: str) -> None:
    size = lens.camera.width, lens.camera.height
    require_size(image.size, size, where=f"{stage}/{image.name}")


def _refuse_unlit(image: LinearImage) -> None:
    brightest = np.percentile(image.rgb, 99.5, axis=(0, 1))
    if brightest.min() < 0.05:
        raise InputError(
            tr("The image is dark (a channel only reaches {v:.1%})").format(v=brightest.min()),
            where=f"background/{image.name}",
            advice=tr("Switch all three LEDs on, or use a longer exposure"),
        )
    share = float(saturated(image.rgb).any(axis=2).mean())
    if share > 0.2:
        raise InputError(
            tr("{share:.0%} of the image is saturated").format(share=share),
            where=f"background/{image.name}",
            advice=tr("Use a shorter exposure"),
        )
