"""From a session folder to a calibration: the stages, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from gelpolight_core import __version__
from gelpolight_core.calibration.calibration import MODELS, Calibration, FullModel, Provenance
from gelpolight_core.calibration.edit import edited
from gelpolight_core.calibration.inputs import FOLDERS, Stage, all_inputs
from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.calibration.refinement import bare_calibration
from gelpolight_core.calibration.results import StageResults, require_balls
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult
from gelpolight_core.lights.crosstalk import CrosstalkResult
from gelpolight_core.lights.positions import LightResult
from gelpolight_core.optics.lens import LensResult
from gelpolight_core.optics.pose import TopPoseResult
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.radiance.whiteboard import RadianceResult
from gelpolight_core.reading import as_text
from gelpolight_core.reflectance.membrane import MEMBRANES
from gelpolight_core.reflectance.stage import ReflectanceResult
from gelpolight_core.response.stage import ResponseResult
from gelpolight_core.session.copies import file_hash, refuse_copies
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS_FILE
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr
from gelpolight_core.who import user_name

Progress = Callable[[str, float], None]
STAGES = tuple(FOLDERS.values())
_SHARES = {
    Stage.RESPONSE: ("camera response", 0.0),
    Stage.LENS: ("lens", 0.02),
    Stage.TOP_POSE: ("top surface", 0.3),
    Stage.LIGHTS: ("lights", 0.4),
    Stage.RADIANCE: ("light intensity", 0.45),
    Stage.BACKGROUND: ("background", 0.48),
    Stage.BALLS: ("ball presses", 0.5),
    Stage.REFLECTANCE: ("reflectance", 0.8),
    Stage.JOINT: ("joint refinement", 0.85),
}
"""Name of each stage, and how much of the whole work is done when it begins."""


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A calibration with the results of every stage, as the pages and the report show them."""

    calibration: Calibration
    response: ResponseResult
    lens: LensResult
    top_pose: TopPoseResult
    lights: LightResult
    crosstalk: CrosstalkResult
    radiance: RadianceResult
    reflectance: ReflectanceResult
    factors: FactorResult
    joint: JointResult | None = None


def calibrate_session(
    session: Session, *, model: str = MODELS[-1], progress: Progress | None = None
) -> CalibrationRun:
    """Calibrate a sensor from its session folder.

    Parameters
    ----------
    session : Session
        What was captured, and what a person decided about it.
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
    refuse_copies(source_files(session))
    results = StageResults()
    stages = stages_of(model)
    ends = [_SHARES[stage][1] for stage in stages[1:]] + [1.0]
    for stage, end in zip(stages, ends, strict=True):
        name, begin = tr(_SHARES[stage][0]), _SHARES[stage][1]
        tell(name, begin)

        def within(share: float, name: str = name, begin: float = begin, end: float = end) -> None:
            tell(name, begin + share * (end - begin))

        results = run_stage(stage, session, results, tell=within)
        if stage is Stage.BALLS:
            require_balls(results)
    tell(tr("done"), 1.0)
    return assemble(session, results, model=model)


def source_files(session: Session) -> tuple[Path, ...]:
    """Return the pictures that a calibration is made from, stage by stage.

    Raises
    ------
    InputError
        If a stage has none.
    """
    stages = (*session.optional_stages, *STAGES)
    return tuple(path for stage in stages for path in session.files(stage))


def _with_edits(calibration: Calibration, session: Session) -> Calibration:
    """Apply the reflectance curves that a person has drawn."""
    curves = {
        channel: (np.array([c for c, _ in nodes]), np.array([v for _, v in nodes]))
        for channel, nodes in session.decisions.curves.items()
    }
    made = calibration.provenance
    return edited(calibration, curves, operator=made.operator, made=made.created)


def stages_of(model: str) -> tuple[Stage, ...]:
    """Return the stages of a model's calibration, in order."""
    return tuple(stage for stage in Stage if model == "full" or stage is not Stage.JOINT)


def assemble(session: Session, results: StageResults, *, model: str = MODELS[-1]) -> CalibrationRun:
    """Put the results of all stages together.

    Parameters
    ----------
    session : Session
        What they were made from.
    results : StageResults
        Of every stage that the model needs.
    model : str, optional
        The model to calibrate for.

    Raises
    ------
    InputError
        If a stage was not run, or a picture of a ball shows none.
    """
    require_balls(results)
    if model != "full":
        results = replace(results, full=None, joint=None)
    bare = bare_calibration(session, results)
    response, crosstalk = results.response, results.crosstalk
    lens, pose, lights = results.lens, results.top_pose, results.lights
    radiance, reflectance, factors = results.radiance, results.reflectance, results.factors
    assert response is not None and crosstalk is not None and lens is not None
    assert pose is not None and lights is not None and radiance is not None
    assert reflectance is not None and factors is not None
    if bare.model != model:
        raise InputError(
            tr("the joint refinement has no result"),
            where=str(session.folder),
            advice=tr("Complete the stages that are still open"),
        )
    calibration = replace(
        bare,
        quality={
            **({"response": response.quality} if response.quality.figures else {}),
            "lens": lens.quality,
            "top_pose": pose.quality,
            "lights": lights.quality,
            "crosstalk": crosstalk.quality,
            "radiance": radiance.quality,
            "reflectance": reflectance.quality,
            "factors": factors.quality,
            **({} if results.full is None else {"joint": judge_joint(results.full)}),
        },
        provenance=_provenance(session),
    )
    calibration = _with_edits(calibration, session)
    return CalibrationRun(
        calibration,
        response,
        lens,
        pose,
        lights,
        crosstalk,
        radiance,
        reflectance,
        factors,
        results.joint,
    )


def judge_joint(full: FullModel) -> QualityTable:
    """Judge the joint refinement."""
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
            *_scale_figures(full),
            *_membrane_figures(full),
            judge("gloss", tr("Glossy share of the membrane"), full.membrane.gloss, warn=0.6),
            judge("bounce", tr("Light from the membrane around"), full.membrane.bounce, warn=1.2),
            judge("decay_mm", tr("Decay length of the drape"), full.decay_mm, "mm"),
        )
    )


def _scale_figures(full: FullModel) -> tuple[Figure, ...]:
    scale = full.scale_sd
    if scale is None:
        return ()
    return (
        judge(
            "ball_height_error_percent",
            tr("Height of ball presses that are reconstructed"),
            100.0 * scale.balls,
            "%",
            warn=2.0,
            fail=10.0,
            advice=tr("Check ball radii, Z1 and the refractive index"),
        ),
        judge(
            "depth_sd_percent",
            tr("Height uncertainty from the calibration"),
            100.0 * scale.depth,
            "%",
            warn=2.0,
            fail=10.0,
            advice=tr("Press more balls, at more places"),
        ),
    )


def _membrane_figures(full: FullModel) -> tuple[Figure, ...]:
    """Return which membrane was kept, and by how much; nothing where no press was held out."""
    two_lobe, one_dimensional = full.membrane_held_out
    if two_lobe <= 0.0:
        return ()
    label = {
        MEMBRANES[0]: tr("Held-out error, one-dimensional over two-lobe (two-lobe kept)"),
        MEMBRANES[1]: tr("Held-out error, one-dimensional over two-lobe (one-dim. kept)"),
    }
    ratio = one_dimensional / two_lobe
    return (judge("membrane_held_out_ratio", label[full.membrane_kept], ratio),)


def _provenance(session: Session) -> Provenance:
    sources = {
        as_text(f"{path.parent.name}/{path.name}"): file_hash(path)
        for path in source_files(session)
    }
    for name in ("session.toml", DECISIONS_FILE):
        if (session.folder / name).is_file():
            sources[name] = file_hash(session.folder / name)
    camera = session.camera_settings
    return Provenance(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        operator=user_name(),
        program_version=__version__,
        session=as_text(session.folder.resolve().name),
        sources=sources,
        inputs=all_inputs(session),
        camera_settings={} if camera is None else camera.as_texts(),
    )
