"""From a session folder to a calibration: the stages, one after the other."""

from __future__ import annotations

import getpass
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gelpolight_core import __version__
from gelpolight_core.calibration.calibration import (
    MODELS,
    Calibration,
    FullModel,
    Provenance,
    sensor_stack,
)
from gelpolight_core.calibration.joint import gather_ball_pixels, refine_jointly
from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS, CalibrationTerms
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult, calibrate_factors
from gelpolight_core.lights.crosstalk import crosstalk_from_spots, unmix
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.lights.positions import LightResult, locate_leds
from gelpolight_core.optics.lens import LensResult, calibrate_lens
from gelpolight_core.optics.pose import TopPoseResult, estimate_top_pose
from gelpolight_core.optics.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.radiance.whiteboard import RadianceResult, calibrate_radiance
from gelpolight_core.reflectance.press import BallPress, find_ball
from gelpolight_core.reflectance.stage import ReflectanceResult, calibrate_reflectance
from gelpolight_core.session.picture import Picture
from gelpolight_core.session.session import (
    ONE_IMAGE_STAGES,
    Session,
    file_hash,
    read_picture,
    require_colour,
)
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
Progress = Callable[[str, float], None]
STAGES = ("checkerboard", "top_pose", *ONE_IMAGE_STAGES, "balls")


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A calibration with the results of every stage, as the pages and the report show them."""

    calibration: Calibration
    lens: LensResult
    top_pose: TopPoseResult
    lights: LightResult
    radiance: RadianceResult
    reflectance: ReflectanceResult
    factors: FactorResult


def calibrate_session(
    session: Session, *, model: str = MODELS[-1], progress: Progress | None = None
) -> CalibrationRun:
    """Calibrate a sensor from its session folder.

    Parameters
    ----------
    session : Session
        What was captured.
    model : str, optional
        The model to calibrate for.
    progress : callable, optional
        Told the stage's name and the share done, 0..1.

    Raises
    ------
    InputError
        If a stage is missing or cannot be used; the message names the file.
    """
    tell = progress or (lambda _stage, _share: None)
    for stage in STAGES:
        session.files(stage)
    tell(tr("lens"), 0.0)
    lens = calibrate_lens(session.pictures("checkerboard"), session.checkerboard)
    tell(tr("top surface"), 0.3)
    pose_pictures = session.pictures("top_pose")
    _same_size(pose_pictures[0], lens.camera.width, lens.camera.height, "top_pose")
    pose = estimate_top_pose(
        pose_pictures, session.top_pose, lens.camera, focal_sd_px=lens.focal_sd_px[0]
    )
    table = build_resampling_table(
        lens.camera,
        pose.plane,
        sensor_stack(session.sensor, pose.plane),
        working_diameter_mm=session.sensor.working_diameter_mm,
    )
    tell(tr("lights"), 0.4)
    lights = locate_leds(
        find_mirror_spots(_stage_picture(session, "mirror", lens)),
        lens.camera,
        pose.plane,
        led_height_mm=session.sensor.led_height_mm,
        plane_distance_sd_mm=pose.distance_sd_mm,
        plane_normal_sd_rad=float(np.radians(pose.normal_sd_deg)),
    )
    tell(tr("light intensity"), 0.45)
    radiance = calibrate_radiance(
        _stage_picture(session, "whiteboard", lens), table, lights.led_positions_mm
    )
    background = _stage_picture(session, "background", lens)
    _refuse_unlit(background)
    bare = table.apply(background.rgb)
    presses, pictures = _find_balls(session, bare, table, lights, lens, radiance, tell)
    tell(tr("reflectance"), 0.8)
    reflectance, factors = _reflectance_and_factors(
        presses, pictures, bare, table, lights, radiance
    )
    full = None
    if model == "full":
        tell(tr("joint refinement"), 0.85)
        crosstalk = crosstalk_from_spots(lights.spots)
        full = _full_model(presses, pictures, bare, table, lights, factors, crosstalk)
    calibration = Calibration(
        sensor=session.sensor,
        model=model,
        camera=lens.camera,
        plane=pose.plane,
        led_positions_mm=lights.led_positions_mm,
        led_covariance_mm2=lights.led_covariance_mm2,
        crosstalk=crosstalk_from_spots(lights.spots),
        radiance=radiance.radiance,
        factors=factors.factors,
        reflectance=reflectance.table,
        noise=_press_noise(presses),
        quality={
            "lens": lens.quality,
            "top_pose": pose.quality,
            "lights": lights.quality,
            "radiance": radiance.quality,
            "reflectance": reflectance.quality,
            "factors": factors.quality,
            **({} if full is None else {"joint": _judge_full(full)}),
        },
        provenance=_provenance(session),
        full=full,
    )
    tell(tr("done"), 1.0)
    return CalibrationRun(calibration, lens, pose, lights, radiance, reflectance, factors)


def refine_again(
    session: Session, run: CalibrationRun, *, terms: CalibrationTerms = ALL_CALIBRATION_TERMS
) -> Calibration:
    """Repeat the joint refinement on a run's stages, with other terms.

    Parameters
    ----------
    session : Session
        What the run was made from.
    run : CalibrationRun
        For either model; its stages are taken as they are.
    terms : CalibrationTerms, optional
        What the full model reckons with.

    Returns
    -------
    Calibration
        For the full model.
    """
    table = run.calibration.table
    crosstalk = run.calibration.crosstalk if terms.crosstalk else np.eye(3)
    bare = table.apply(_stage_picture(session, "background", run.lens).rgb)
    pictures = tuple(
        table.apply(_ball_picture(path, run.lens).rgb) for path in session.files("balls")
    )
    presses = run.reflectance.presses
    full = _full_model(
        presses, pictures, bare, table, run.lights, run.factors, crosstalk, terms=terms
    )
    quality = {**run.calibration.quality, "joint": _judge_full(full)}
    return replace(run.calibration, model="full", crosstalk=crosstalk, quality=quality, full=full)


def _reflectance_and_factors(
    presses: tuple[BallPress, ...],
    pictures: tuple[Map, ...],
    bare: Map,
    table: ResamplingTable,
    lights: LightResult,
    radiance: RadianceResult,
) -> tuple[ReflectanceResult, FactorResult]:
    """Fit the table, then the factors, and feed these back once (section V-E)."""
    leds = lights.led_positions_mm
    first = calibrate_reflectance(presses, pictures, table, leds, radiance)
    factors = calibrate_factors(bare, table, leds, radiance, first.table)
    second = calibrate_reflectance(presses, pictures, table, leds, radiance, factors.factors)
    return second, calibrate_factors(bare, table, leds, radiance, second.table)


def _press_noise(presses: tuple[BallPress, ...]) -> NDArray[np.float64]:
    """Return the noise of press minus background, per channel, over all presses."""
    return np.asarray(np.mean([p.indentation.noise for p in presses], axis=0), np.float64)


def _full_model(
    presses: tuple[BallPress, ...],
    pictures: tuple[Map, ...],
    bare: Map,
    table: ResamplingTable,
    lights: LightResult,
    factors: FactorResult,
    crosstalk: NDArray[np.float64],
    *,
    terms: CalibrationTerms = ALL_CALIBRATION_TERMS,
) -> FullModel:
    """Refine LEDs and membrane on the presses, and keep the background to compare with."""
    background = unmix(bare, crosstalk)
    noise = _press_noise(presses)
    pixels = [
        gather_ball_pixels(
            press, unmix(picture, crosstalk), background, table, factors.usable, noise
        )
        for press, picture in zip(presses, pictures, strict=True)
    ]
    joint = refine_jointly(presses, pixels, lights.led_positions_mm, terms=terms)
    return FullModel(
        joint.led_positions_mm,
        joint.led_sd_mm if joint.kept == "refined" else _mirror_sd(lights),
        joint.membrane,
        background,
        joint.decay_mm,
        joint.misfit,
        joint.held_out,
        joint.kept,
    )


def _mirror_sd(lights: LightResult) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.diagonal(lights.led_covariance_mm2, axis1=1, axis2=2)))


def _judge_full(full: FullModel) -> QualityTable:
    return QualityTable(
        (
            judge(
                "joint_misfit_percent",
                tr("Ball presses and drapes not explained"),
                100.0 * full.misfit,
                "%",
                warn=4.0,
                fail=12.0,
                advice=tr("Check ball radii, then repeat the worst presses"),
            ),
            judge(
                "joint_led_sd_mm",
                tr("LED position after refinement, standard deviation"),
                float(np.linalg.norm(full.led_sd_mm, axis=1).max()),
                "mm",
                warn=0.2,
                fail=1.0,
                advice=tr("Press more balls, at more places"),
            ),
            judge("gloss", tr("Glossy share of the membrane"), full.membrane.gloss, warn=0.6),
            judge("bounce", tr("Light from the membrane around"), full.membrane.bounce, warn=1.2),
            judge("decay_mm", tr("Decay length of the drape"), full.decay_mm, "mm"),
        )
    )


def _find_balls(
    session: Session,
    bare: Map,
    table: ResamplingTable,
    lights: LightResult,
    lens: LensResult,
    radiance: RadianceResult,
    tell: Progress,
) -> tuple[tuple[BallPress, ...], tuple[Map, ...]]:
    crosstalk = crosstalk_from_spots(lights.spots)
    clean = unmix(bare, crosstalk)
    presses, pictures = [], []
    files = session.files("balls")
    for index, path in enumerate(files):
        tell(tr("ball presses"), 0.5 + 0.3 * index / len(files))
        radius = session.ball_radius_mm(path.name)
        seen = table.apply(_ball_picture(path, lens).rgb)
        presses.append(
            find_ball(
                unmix(seen, crosstalk),
                clean,
                table,
                lights.led_positions_mm,
                radius_mm=radius,
                name=f"balls/{path.name}",
                usable=radiance.usable,
            )
        )
        pictures.append(seen)
    return tuple(presses), tuple(pictures)


def _ball_picture(path: Path, lens: LensResult) -> Picture:
    picture = read_picture(path)
    require_colour(picture, where=str(path))
    _same_size(picture, lens.camera.width, lens.camera.height, "balls")
    return picture


def _stage_picture(session: Session, stage: str, lens: LensResult) -> Picture:
    picture = session.averaged(stage)
    require_colour(picture, where=f"{stage}/{picture.name}")
    _same_size(picture, lens.camera.width, lens.camera.height, stage)
    return picture


def _same_size(picture: Picture, width: int, height: int, stage: str) -> None:
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


def _provenance(session: Session) -> Provenance:
    sources = {
        f"{stage}/{path.name}": file_hash(path) for stage in STAGES for path in session.files(stage)
    }
    sources["session.toml"] = file_hash(session.folder / "session.toml")
    try:
        operator = getpass.getuser()
    except (KeyError, OSError):  # a container without a user database has no name to give
        operator = ""
    return Provenance(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        operator=operator,
        program_version=__version__,
        session=session.folder.resolve().name,
        sources=sources,
    )
