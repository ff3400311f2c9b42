"""The stages of a calibration: what each needs, and one function that runs it.

The command line runs them one after the other; the desktop program runs each as soon as it has
what it needs, keeps the results, and runs again only what a new picture or decision has made
stale. Both call :func:`run_stage` and therefore come to the same numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.ball_pixels import gather_ball_pixels
from gelpolight_core.calibration.calibration import (
    Calibration,
    FullModel,
    Provenance,
    ScaleSd,
    sensor_stack,
)
from gelpolight_core.calibration.depth_scale import (
    ball_height_error,
    depth_scale_sd,
    lateral_scale_sd,
)
from gelpolight_core.calibration.inputs import NEEDS, Stage, inputs_of
from gelpolight_core.calibration.joint import JointResult, refine_jointly
from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS, CalibrationTerms
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult, calibrate_factors
from gelpolight_core.lights.crosstalk import CrosstalkResult, find_crosstalk, unmix
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.lights.positions import LightResult, locate_leds
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.lens import LensResult, calibrate_lens
from gelpolight_core.optics.pose import TopPoseResult, estimate_top_pose
from gelpolight_core.optics.refraction import LayerStack, camera_to_membrane
from gelpolight_core.optics.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.radiance.whiteboard import RadianceResult, calibrate_radiance
from gelpolight_core.reflectance.press import BallPress, PlacedContact, find_ball
from gelpolight_core.reflectance.stage import ReflectanceResult, calibrate_reflectance
from gelpolight_core.response.stage import ResponseResult, declare_response, measure_response
from gelpolight_core.session.copies import file_hash
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.session.picture import Picture
from gelpolight_core.session.session import (
    Session,
    require_colour,
)
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
Progress = Callable[[float], None]
T = TypeVar("T")
CHECKED_BALLS = 4


@dataclass(frozen=True, slots=True)
class SeenBall:
    """What was made of one picture of a ball press.

    Attributes
    ----------
    file : str
        Its name in ``balls``.
    key : str
        Changes with anything that the finding rests on.
    picture : (rows, columns, 3) float32
        Resampled onto the grid.
    press : BallPress or None
        The ball; None where none was found.
    fault : InputError or None
        Why not.
    """

    file: str
    key: str
    picture: Map
    press: BallPress | None
    fault: InputError | None


@dataclass(frozen=True, slots=True)
class StageResults:
    """The results of all stages that were run; None where a stage was not."""

    response: ResponseResult | None = None
    lens: LensResult | None = None
    top_pose: TopPoseResult | None = None
    table: ResamplingTable | None = None
    lights: LightResult | None = None
    crosstalk: CrosstalkResult | None = None
    radiance: RadianceResult | None = None
    background: Map | None = None
    balls: tuple[SeenBall, ...] = ()
    reflectance: ReflectanceResult | None = None
    factors: FactorResult | None = None
    joint: JointResult | None = None
    full: FullModel | None = None

    @property
    def presses(self) -> tuple[BallPress, ...]:
        """The balls that were found."""
        return tuple(ball.press for ball in self.balls if ball.press is not None)

    @property
    def pictures(self) -> tuple[Map, ...]:
        """Their pictures, resampled."""
        return tuple(ball.picture for ball in self.balls if ball.press is not None)


def run_stage(
    stage: Stage, session: Session, results: StageResults, *, tell: Progress | None = None
) -> StageResults:
    """Run one stage on the results of the earlier ones.

    Parameters
    ----------
    stage : Stage
        Which.
    session : Session
        Pictures and decisions.
    results : StageResults
        Those of all stages that this one needs; balls found earlier are used again where nothing
        they rest on has changed.
    tell : callable, optional
        Told the share of this stage done, 0..1.

    Returns
    -------
    StageResults
        With this stage's result in place.

    Raises
    ------
    InputError
        If the stage's pictures are missing or cannot be used. A picture of a ball without a ball
        is kept in the results with its fault; :func:`require_balls` raises it.
    """
    if results.response is not None:
        session = replace(session, response=results.response.response)
    return _RUNS[stage](session, results, tell or (lambda _share: None))


def require_balls(results: StageResults) -> None:
    """Raise the fault of the first picture in which no ball was found."""
    for ball in results.balls:
        if ball.fault is not None:
            raise ball.fault


def _need(value: T | None, what: str) -> T:
    if value is None:
        raise InputError(
            tr("an earlier stage has no result yet"),
            where=what,
            advice=tr("Complete the earlier stages first"),
        )
    return value


def _run_response(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    if "response" in session.optional_stages:
        response = measure_response(*session.series(), declared=session.declared_response)
    else:
        response = declare_response(session.declared_response)
    return replace(results, response=response)


def _run_lens(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    lens = calibrate_lens(session.pictures("checkerboard"), session.checkerboard)
    return replace(results, lens=lens)


def _run_top_pose(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    lens = _need(results.lens, "top_pose")
    pictures = session.pictures("top_pose")
    _same_size(pictures[0], lens, "top_pose")
    pose = estimate_top_pose(
        pictures, session.top_pose, lens.camera, focal_sd_px=lens.focal_sd_px[0]
    )
    table = build_resampling_table(
        lens.camera,
        pose.plane,
        sensor_stack(session.sensor, pose.plane),
        working_diameter_mm=session.sensor.working_diameter_mm,
    )
    return replace(results, top_pose=pose, table=table)


def _run_lights(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    lens, pose = _need(results.lens, "mirror"), _need(results.top_pose, "mirror")
    spots = find_mirror_spots(
        _stage_picture(session, "mirror", lens), placed=session.decisions.spots_px
    )
    lights = locate_leds(
        spots,
        lens.camera,
        pose.plane,
        led_height_mm=session.sensor.led_height_mm,
        plane_distance_sd_mm=pose.distance_sd_mm,
        plane_normal_sd_rad=float(np.radians(pose.normal_sd_deg)),
    )
    crosstalk = find_crosstalk(spots, _single_led(session, lens))
    return replace(results, lights=lights, crosstalk=crosstalk)


def _single_led(session: Session, lens: LensResult) -> tuple[Picture, ...]:
    if "single_led" not in session.optional_stages:
        return ()
    pictures = session.single_led()
    for picture in pictures:
        require_colour(picture, where=f"single_led/{picture.name}")
    _same_size(pictures[0], lens, "single_led")
    return pictures


def _run_radiance(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    lens, table = _need(results.lens, "whiteboard"), _need(results.table, "whiteboard")
    lights = _need(results.lights, "whiteboard")
    whiteboard = _stage_picture(session, "whiteboard", lens)
    return replace(results, radiance=calibrate_radiance(whiteboard, table, lights.led_positions_mm))


def _run_background(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    lens, table = _need(results.lens, "background"), _need(results.table, "background")
    background = _stage_picture(session, "background", lens)
    _refuse_unlit(background)
    return replace(results, background=table.apply(background.rgb))


def _run_balls(session: Session, results: StageResults, tell: Progress) -> StageResults:
    known = {ball.key: ball for ball in results.balls}
    rests_on = {stage: inputs.fingerprint for stage, inputs in inputs_of(session).items()}
    files = session.files("balls")
    balls = []
    for index, path in enumerate(files):
        tell(index / len(files))
        key = _ball_key(path, session, rests_on)
        balls.append(known[key] if key in known else _look_for_ball(path, key, session, results))
    return replace(results, balls=tuple(balls))


def _ball_key(path: Path, session: Session, rests_on: Mapping[Stage, str]) -> str:
    parts = [rests_on[need] for need in NEEDS[Stage.BALLS]]
    stated = (path.name, session.ball_radius_mm(path.name), session.decisions.balls.get(path.name))
    return hashlib.sha256(repr((parts, stated, file_hash(path))).encode()).hexdigest()


def _look_for_ball(path: Path, key: str, session: Session, results: StageResults) -> SeenBall:
    lens, table = _need(results.lens, "balls"), _need(results.table, "balls")
    lights, radiance = _need(results.lights, "balls"), _need(results.radiance, "balls")
    bare = _need(results.background, "balls")
    crosstalk = _need(results.crosstalk, "balls").matrix
    picture = session.picture(path)
    radius = session.ball_radius_mm(path.name)
    require_colour(picture, where=str(path))
    _same_size(picture, lens, "balls")
    seen = table.apply(picture.rgb)
    pose = _need(results.top_pose, "balls")
    stack = sensor_stack(session.sensor, pose.plane)
    placed = session.decisions.balls.get(path.name)
    try:
        contact = None
        if placed is not None:
            contact = placed_contact(placed, lens.camera, pose.plane, stack)
        press = find_ball(
            unmix(seen, crosstalk),
            unmix(bare, crosstalk),
            table,
            lights.led_positions_mm,
            radius_mm=radius,
            name=f"balls/{path.name}",
            usable=radiance.usable,
            placed=contact,
        )
    except InputError as fault:
        return SeenBall(path.name, key, seen, None, fault)
    return SeenBall(path.name, key, seen, press, None)


def placed_contact(
    circle: PlacedCircle, camera: Camera, plane: TopPlane, stack: LayerStack
) -> PlacedContact:
    """Return where on the undeformed membrane a circle placed in the raw picture is seen.

    Raises
    ------
    InputError
        If it reaches beyond what the camera can see of the membrane.
    """
    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    u = circle.u_px + circle.radius_px * np.cos(turns)
    v = circle.v_px + circle.radius_px * np.sin(turns)
    edge_mm, _ = camera_to_membrane(camera.directions(np.stack([u, v], axis=-1)), plane, stack)
    if not np.isfinite(edge_mm).all():
        raise InputError(
            tr("the circle placed by hand reaches beyond what the camera sees of the membrane"),
            where=tr("balls"),
            advice=tr("Move it inside the working area, or leave the picture out"),
        )
    middle = edge_mm.mean(axis=0)
    radius_mm = float(np.hypot(*(edge_mm - middle).T).mean())
    return PlacedContact((float(middle[0]), float(middle[1])), radius_mm)


def _run_reflectance(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    """Fit the table, then the factors, and feed these back once (section V-E)."""
    del session
    table, lights = _need(results.table, "balls"), _need(results.lights, "balls")
    radiance, bare = _need(results.radiance, "balls"), _need(results.background, "balls")
    leds, presses, pictures = lights.led_positions_mm, results.presses, results.pictures
    first = calibrate_reflectance(presses, pictures, table, leds, radiance)
    factors = calibrate_factors(bare, table, leds, radiance, first.table)
    second = calibrate_reflectance(presses, pictures, table, leds, radiance, factors.factors)
    factors = calibrate_factors(bare, table, leds, radiance, second.table)
    return replace(results, reflectance=second, factors=factors)


def _run_joint(session: Session, results: StageResults, _tell: Progress) -> StageResults:
    refined = refine_with(results)
    assert refined.joint is not None and refined.full is not None
    scale = _scale_sd(session, refined, refined.joint, refined.full)
    return replace(refined, full=replace(refined.full, scale_sd=scale))


def refine_with(
    results: StageResults, *, terms: CalibrationTerms = ALL_CALIBRATION_TERMS
) -> StageResults:
    """Refine LEDs and membrane on the presses, and keep the background to compare with.

    Parameters
    ----------
    results : StageResults
        Of all earlier stages.
    terms : CalibrationTerms, optional
        What the full model reckons with.
    """
    table, lights = _need(results.table, "balls"), _need(results.lights, "balls")
    bare, factors = _need(results.background, "balls"), _need(results.factors, "balls")
    found = _need(results.crosstalk, "balls")
    if not terms.crosstalk:
        found = replace(found, matrix=np.eye(3))
    crosstalk = found.matrix
    background = unmix(bare, crosstalk)
    noise = press_noise(results.presses)
    pixels = [
        gather_ball_pixels(
            press, unmix(picture, crosstalk), background, table, factors.usable, noise
        )
        for press, picture in zip(results.presses, results.pictures, strict=True)
    ]
    joint = refine_jointly(results.presses, pixels, lights.led_positions_mm, terms=terms)
    full = FullModel(
        joint.led_positions_mm,
        joint.led_sd_mm if joint.kept == "refined" else _mirror_sd(lights),
        joint.membrane,
        background,
        joint.decay_mm,
        joint.misfit,
        joint.held_out,
        joint.kept,
        joint.membrane_sd,
        joint.membrane_held_out,
        joint.membrane_kept,
    )
    return replace(results, crosstalk=found, joint=joint, full=full)


def _scale_sd(
    session: Session, results: StageResults, joint: JointResult, full: FullModel
) -> ScaleSd:
    """Say how sure the lengths of the full model are."""
    calibration = bare_calibration(session, replace(results, full=full))
    lens, pose = _need(results.lens, "balls"), _need(results.top_pose, "balls")
    covariance = joint.covariance.copy()
    if joint.kept == "mirror":
        for k, own in enumerate(calibration.led_covariance_mm2):
            covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = own
    files = [ball.file for ball in results.balls if ball.press is not None]
    # Evenly over the session, so that one odd press does not decide.
    some = np.unique(np.linspace(0, len(files) - 1, CHECKED_BALLS).round().astype(int)).tolist()
    unexplained = ball_height_error(
        calibration,
        [session.picture(session.folder / "balls" / files[i]).rgb for i in some],
        [joint.balls[i] for i in some],
    )
    lateral = lateral_scale_sd(
        calibration.stack, pose.distance_sd_mm, lens.focal_sd_px[0] / lens.camera.fx
    )
    fitted = depth_scale_sd(full, calibration.table, covariance)
    together = float(np.linalg.norm([fitted, unexplained, lateral]))
    return ScaleSd(together, lateral, unexplained)


def bare_calibration(session: Session, results: StageResults) -> Calibration:
    """Return what a reconstruction needs of the results, without figures and provenance.

    Raises
    ------
    InputError
        If a stage was not run.
    """
    where = str(session.folder)
    lens, pose = _need(results.lens, where), _need(results.top_pose, where)
    lights, radiance = _need(results.lights, where), _need(results.radiance, where)
    return Calibration(
        sensor=session.sensor,
        model="paper" if results.full is None else "full",
        camera=lens.camera,
        plane=pose.plane,
        led_positions_mm=lights.led_positions_mm,
        led_covariance_mm2=lights.led_covariance_mm2,
        crosstalk=_need(results.crosstalk, where).matrix,
        radiance=radiance.radiance,
        factors=_need(results.factors, where).factors,
        reflectance=_need(results.reflectance, where).table,
        noise=press_noise(results.presses),
        quality={},
        provenance=Provenance("", "", "", "", {}),
        full=results.full,
        response=_need(results.response, where).response,
    )


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
        Stage.JOINT: _run_joint,
    }
)


def press_noise(presses: tuple[BallPress, ...]) -> NDArray[np.float64]:
    """Return the noise of press minus background, per channel, over all presses."""
    return np.asarray(np.mean([p.indentation.noise for p in presses], axis=0), np.float64)


def _mirror_sd(lights: LightResult) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.diagonal(lights.led_covariance_mm2, axis1=1, axis2=2)))


def _stage_picture(session: Session, stage: str, lens: LensResult) -> Picture:
    picture = session.averaged(stage)
    require_colour(picture, where=f"{stage}/{picture.name}")
    _same_size(picture, lens, stage)
    return picture


def _same_size(picture: Picture, lens: LensResult, stage: str) -> None:
    width, height = lens.camera.width, lens.camera.height
    if picture.size != (width, height):
        raise InputError(
            tr("the picture is {w}x{h} pixels, the checkerboard pictures are {cw}x{ch}").format(
                w=picture.size[0], h=picture.size[1], cw=width, ch=height
            ),
            where=f"{stage}/{picture.name}",
            advice=tr("Capture all stages at one picture size"),
        )


def _refuse_unlit(picture: Picture) -> None:
    brightest = np.percentile(picture.rgb, 99.5, axis=(0, 1))
    if brightest.min() < 0.05:
        raise InputError(
            tr("the picture is dark (a channel reaches only {v:.1%})").format(v=brightest.min()),
            where=f"background/{picture.name}",
            advice=tr("Switch all three LEDs on, or expose longer"),
        )
    saturated = float((picture.rgb >= 0.995).any(axis=2).mean())
    if saturated > 0.2:
        raise InputError(
            tr("{share:.0%} of the picture is saturated").format(share=saturated),
            where=f"background/{picture.name}",
            advice=tr("Shorten the exposure"),
        )
