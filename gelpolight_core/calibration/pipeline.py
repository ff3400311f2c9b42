"""From a session folder to a calibration: all stages in order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gelpolight_core.calibration.edit import edited
from gelpolight_core.calibration.inputs import FOLDERS, NEEDS, Stage, all_inputs
from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.calibration.provenance import provenance_of
from gelpolight_core.calibration.refinement import bare_calibration
from gelpolight_core.calibration.results import StageResults, judge_balls, require_balls
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.calibration.titles import stage_title
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult
from gelpolight_core.finding import Finding, QualityTable, judge
from gelpolight_core.lights.crosstalk import CrosstalkResult
from gelpolight_core.lights.positions import LightResult
from gelpolight_core.optics.lens import LensResult
from gelpolight_core.optics.pose import TopPoseResult
from gelpolight_core.radiance.whiteboard import RadianceResult
from gelpolight_core.reflectance.agreement import LEAST_PRESSES
from gelpolight_core.reflectance.membrane import MEMBRANES
from gelpolight_core.reflectance.stage import ReflectanceResult
from gelpolight_core.response.stage import ResponseResult
from gelpolight_core.sensor_calibration import MODELS, Calibration, FullModel
from gelpolight_core.session.file_hashes import refuse_copies
from gelpolight_core.session.missing import refuse_missing_stages
from gelpolight_core.session.session import Session
from gelpolight_core.stated_lengths import HEIGHT_BY_RADIUS
from gelpolight_core.translation import pattern, tr

Progress = Callable[[str, float], None]
STAGES = tuple(FOLDERS[stage] for stage in NEEDS if stage in FOLDERS)
_BEGINS = {
    Stage.RESPONSE: 0.0,
    Stage.LENS: 0.02,
    Stage.TOP_POSE: 0.3,
    Stage.LIGHTS: 0.4,
    Stage.RADIANCE: 0.45,
    Stage.BACKGROUND: 0.48,
    Stage.BALLS: 0.5,
    Stage.REFLECTANCE: 0.8,
    Stage.JOINT: 0.85,
}
"""Share of the total work done when a stage begins."""

MOST_HEIGHT_ERROR = 4.0
"""Percent of height from which on a calibration fails: half of the error of the paper's method."""
RADIUS_WARN_PERCENT, RADIUS_FAIL_PERCENT = 3.0, MOST_HEIGHT_ERROR / HEIGHT_BY_RADIUS
"""Of all ball radii; the larger one makes heights wrong by `MOST_HEIGHT_ERROR`."""


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A calibration with the results of every stage, as shown by the wizard and the report."""

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
        Captured images and the user's decisions.
    model : str, optional
        The model to calibrate for.
    progress : callable, optional
        Called with the stage name and the share done, 0..1.

    Raises
    ------
    InputError
        If a stage is missing or cannot be used; the message names the file.
    """
    progress = progress or (lambda _stage, _share: None)
    refuse_copies(source_files(session))
    results = StageResults()
    stages = stages_of(model)
    ends = [_BEGINS[stage] for stage in stages[1:]] + [1.0]
    for stage, end in zip(stages, ends, strict=True):
        name, begin = stage_title(stage), _BEGINS[stage]
        progress(name, begin)

        def within(share: float, name: str = name, begin: float = begin, end: float = end) -> None:
            progress(name, begin + share * (end - begin))

        results = run_stage(stage, session, results, progress=within)
        if stage is Stage.BALLS:
            require_balls(results)
    progress(tr("done"), 1.0)
    return assemble(session, results, model=model)


def source_files(session: Session) -> tuple[Path, ...]:
    """Return the images that a calibration is made from, stage by stage.

    Raises
    ------
    InputError
        If a stage has none.
    """
    refuse_missing_stages(session.folder, session.decisions.excluded)
    stages = (*session.optional_stages, *STAGES)
    return tuple(path for stage in stages for path in session.files(stage))


def _with_edits(calibration: Calibration, session: Session) -> Calibration:
    """Apply the reflectance curves drawn by the user."""
    curves = {
        channel: (np.array([c for c, _ in nodes]), np.array([v for _, v in nodes]))
        for channel, nodes in session.decisions.curves.items()
    }
    made = calibration.provenance
    return edited(calibration, curves, operator=made.operator, made=made.created)


def stages_of(model: str) -> tuple[Stage, ...]:
    """Return the stages of a calibration for a model, in order."""
    return tuple(stage for stage in NEEDS if model == "full" or stage is not Stage.JOINT)


def assemble(session: Session, results: StageResults, *, model: str = MODELS[-1]) -> CalibrationRun:
    """Combine the results of all stages.

    Parameters
    ----------
    session : Session
        The session that they come from.
    results : StageResults
        Results of every stage that the model needs.
    model : str, optional
        The model to calibrate for.

    Raises
    ------
    InputError
        If a stage was not run, or no ball capture shows a ball.
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
            tr("The joint refinement has no result"),
            where=str(session.folder),
            advice=tr("Complete the stages that are not done yet"),
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
            "background": results.bare_membrane or QualityTable(),
            "balls": judge_balls(results),
            "reflectance": reflectance.quality,
            "factors": factors.quality,
            **({} if results.full is None else {"joint": judge_joint(results, results.full)}),
        },
        provenance=provenance_of(session, source_files(session), inputs=all_inputs(session)),
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


def judge_joint(results: StageResults, full: FullModel) -> QualityTable:
    """Judge the joint refinement of these results, and its model."""
    return QualityTable(
        (
            judge(
                "joint_misfit_percent",
                tr("Unexplained signal of ball presses and drapes"),
                100.0 * full.misfit,
                "%",
                warn=4.0,
                fail=12.0,
                remedy=tr("Check the ball radii, then repeat the worst presses"),
            ),
            judge(
                "joint_led_sd_mm",
                tr("LED position after refinement, standard deviation"),
                float(np.linalg.norm(full.led_sd_mm, axis=1).max()),
                "mm",
                warn=0.2,
                fail=1.0,
                remedy=tr("Press more balls at more positions"),
            ),
            *(() if results.joint is None else judge_presses(results.joint)),
            *(() if results.joint is None else judge_radii(results.joint)),
            *_scale_figures(full),
            *_membrane_figures(full),
            judge("gloss", tr("Glossy share of the membrane"), full.membrane.gloss, warn=0.6),
            judge(
                "interreflection",
                tr("Interreflection of the membrane"),
                full.membrane.interreflection,
                warn=1.2,
            ),
            judge("decay_mm", tr("Decay length of the drape"), full.decay_mm, "mm"),
        )
    )


def judge_presses(joint: JointResult) -> tuple[Finding, ...]:
    """Judge the ball press with the largest residual, compared with the others.

    Parameters
    ----------
    joint : JointResult
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
            tr("Unexplained signal of the worst press over the usual ({name})").format(name=worst),
            float(np.nanmax(misfits) / np.nanmedian(misfits)),
            warn=1.5,
            fail=2.0,
            remedy=tr(
                "Check the stated diameter of {name}; clean the membrane and repeat the press"
            ).format(name=worst),
        ),
    )


def judge_radii(joint: JointResult) -> tuple[Finding, ...]:
    """Judge whether all stated ball radii have a common error, or contradict the other lengths."""
    factor = joint.radius_factor
    if factor is None:
        return ()
    off = 100.0 * (max(factor, 1.0 / factor) - 1.0)
    seen = tr("In the images all balls look {p:.0f} % smaller than stated")
    if factor > 1.0:
        seen = tr("In the images all balls look {p:.0f} % larger than stated")
    advice = tr(
        "Measure the ball diameters and correct them. If they are right, measure the squares of"
        " the board on the top surface, and check the layers"
    )
    return (
        judge(
            "common_radius_percent",
            tr("All stated ball radii against the images"),
            off,
            "%",
            warn=RADIUS_WARN_PERCENT,
            fail=RADIUS_FAIL_PERCENT,
            remedy=pattern("{seen}. {advice}", seen=seen.format(p=off), advice=advice),
        ),
    )


def _scale_figures(full: FullModel) -> tuple[Finding, ...]:
    scale = full.scale_sd
    if scale is None:
        return ()
    lengths = tr("Check the ball radii, the LED height and the refractive index")
    stated_wrong = scale.balls**2 > 0.5 * scale.depth**2
    return (
        judge(
            "ball_height_error_percent",
            tr("Height error of reconstructed ball presses"),
            100.0 * scale.balls,
            "%",
            warn=2.0,
            fail=MOST_HEIGHT_ERROR,
            remedy=lengths,
        ),
        judge(
            "depth_sd_percent",
            tr("Height uncertainty from the calibration"),
            100.0 * scale.depth,
            "%",
            warn=2.0,
            fail=MOST_HEIGHT_ERROR,
            # More balls reduce scatter, but not an error common to all heights.
            remedy=lengths if stated_wrong else tr("Press more balls at more positions"),
        ),
    )


def _membrane_figures(full: FullModel) -> tuple[Finding, ...]:
    """Return the selected membrane and the ratio of errors; empty if no press was held out."""
    two_lobe, one_dimensional = full.membrane_held_out
    if two_lobe <= 0.0:
        return ()
    label = {
        MEMBRANES[0]: tr("Held-out error ratio, one-dimensional over two-lobe (two-lobe kept)"),
        MEMBRANES[1]: tr(
            "Held-out error ratio, one-dimensional over two-lobe (one-dimensional kept)"
        ),
    }
    ratio = one_dimensional / two_lobe
    return (judge("membrane_held_out_ratio", label[full.membrane_kept], ratio),)
