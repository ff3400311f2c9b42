"""Benefit and cost of each term of the full model: each term is left out in turn.

Terms of a frame are left out of the reconstruction only. Terms of the membrane and the LEDs are
left out of the joint refinement, so that the other terms can compensate as far as possible. Times
are processor times of all threads together, so that other programs have little effect. Every press
is reconstructed by all variants in turn, so that a slow phase of the machine affects all equally.
The cost of a term is the median of the differences for one press.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import assemble, stages_of
from gelpolight_core.calibration.refinement import bare_calibration, refine_with
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS, CalibrationTerms
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.score import (
    DepthScore,
    ScoreSummary,
    TrueDepth,
    read_true_depth,
    score_depth,
    scored_radius_mm,
    summarise,
)
from gelpolight_core.measurement.truth import PressTruth, read_truth
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import require_colour
from gelpolight_core.session.session import Session
from gelpolight_core.translation import marked, tr

CALIBRATING = 0.6
"""Share of the calibrations in the total work, for the progress."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Variant:
    """The full model with a term left out.

    Attributes
    ----------
    name : str
        On the command line and in files.
    label : str
        The replacement, as shown to the user.
    terms : Terms
        Of the reconstruction.
    calibration : CalibrationTerms
        Of the joint refinement.
    model : str
        ``full``, or ``paper`` for the paper's model, which does not use these terms.
    """

    name: str
    label: str
    terms: Terms = ALL_TERMS
    calibration: CalibrationTerms = ALL_CALIBRATION_TERMS
    model: str = "full"


EVERYTHING = Variant("all", marked("all terms on"))
VARIANTS = (
    Variant("near_light_0", marked("light computed for depth 0 only"), Terms(near_light_rounds=0)),
    Variant("near_light_1", marked("near light: 1 coarse round"), Terms(near_light_rounds=1)),
    Variant("near_light_3", marked("near light: 3 coarse rounds"), Terms(near_light_rounds=3)),
    Variant(
        "ray_true_slopes", marked("slopes without ray correction"), Terms(ray_true_slopes=False)
    ),
    Variant("true_positions", marked("positions at depth 0"), Terms(true_positions=False)),
    Variant("shadows", marked("dark channels used"), Terms(shadows=False)),
    Variant("saturation", marked("saturated channels used"), Terms(saturation=False)),
    Variant("weights", marked("plain sine transform, no weights"), Terms(weights=False)),
    Variant("free_boundary", marked("boundary fixed at depth 0"), Terms(free_boundary=False)),
    Variant("denoising", marked("uniform areas not averaged"), Terms(denoising=False)),
    Variant("sharpening", marked("images not sharpened"), Terms(sharpening=False)),
    Variant(
        "interreflection",
        marked("no interreflection"),
        calibration=CalibrationTerms(interreflection=False),
    ),
    Variant("gloss", marked("no glossy lobe"), calibration=CalibrationTerms(gloss=False)),
    Variant(
        "curves",
        marked("no reflectance curves"),
        calibration=CalibrationTerms(curves=False),
    ),
    Variant(
        "crosstalk", marked("crosstalk not removed"), calibration=CalibrationTerms(crosstalk=False)
    ),
    Variant(
        "led_refinement",
        marked("LED positions from mirror spots"),
        calibration=CalibrationTerms(led_refinement=False),
    ),
    Variant("paper", marked("the paper's model"), model="paper"),
)


@dataclass(frozen=True, slots=True)
class TermResult:
    """One variant on one sensor.

    Attributes
    ----------
    variant : Variant
        What was left out.
    score : ScoreSummary
        Errors without the term.
    frame_ms : float
        Median processor time of a frame without the term.
    cost_ms : float
        Additional time per frame by the term: median difference to all terms on; 0 for all terms
        on.
    calibration_s : float
        Processor time of the joint refinement of the variant; NaN for the paper's model.
    """

    variant: Variant
    score: ScoreSummary
    frame_ms: float
    cost_ms: float
    calibration_s: float


@dataclass(frozen=True, slots=True)
class Ablation:
    """All variants on one sensor; the first has all terms on.

    Attributes
    ----------
    sensor : str
        The session folder's name.
    results : tuple of TermResult
        In the order of :data:`VARIANTS`.
    repeats : int
        Number of timed runs per press.
    refused : tuple of (Variant, str)
        Variants whose calibration is refused, with the reason.
    """

    sensor: str
    results: tuple[TermResult, ...]
    repeats: int
    refused: tuple[tuple[Variant, str], ...] = ()


@dataclass(frozen=True, slots=True)
class TruePress:
    """A press with its truth.

    Attributes
    ----------
    row : PressTruth
        Its row of ``truth.csv``.
    rgb : (height, width, 3) float32
        Its image, linear light.
    truth : TrueDepth
        Its true depth.
    """

    row: PressTruth
    rgb: NDArray[np.float32]
    truth: TrueDepth


@dataclass(slots=True)
class _Candidate:
    """A variant during the run: its reconstructor and its results so far."""

    variant: Variant
    reconstruct: Reconstructor
    calibration_s: float
    scores: list[DepthScore] = field(default_factory=list)
    times_ms: list[float] = field(default_factory=list)


def ablate(
    session: Session,
    *,
    variants: Sequence[Variant] = VARIANTS,
    repeats: int = 1,
    workers: int = 2,
    progress: Progress | None = None,
) -> Ablation:
    """Calibrate a session and reconstruct its presses with each term left out.

    Parameters
    ----------
    session : Session
        With ``presses/truth.csv`` and ``truth/*.npz`` in addition to the images of the stages.
    variants : sequence of Variant, optional
        The variants, which are compared with all terms on.
    repeats : int, optional
        Number of reconstructions of each press, for the times.
    workers : int, optional
        Threads of a reconstruction.
    progress : callable, optional
        Called with the present task and the share done, 0..1.

    Raises
    ------
    InputError
        If the session cannot be calibrated, or a press has no image or no truth.
    """
    progress = progress or (lambda _what, _share: None)
    radius_mm = scored_radius_mm(session.sensor)
    seen = run_stage(Stage.RESPONSE, session, StageResults()).response
    linear = session if seen is None else replace(session, response=seen.response)
    presses = read_presses(linear, radius_mm)
    candidates, refused = _calibrated(session, (EVERYTHING, *variants), workers, progress)
    for candidate in candidates:
        candidate.reconstruct.depth(presses[0].rgb, normals=False)  # prepares maps and kernels
    for number, press in enumerate(presses):
        progress(press.row.file, CALIBRATING + (1.0 - CALIBRATING) * number / len(presses))
        _take_in_turn(candidates, press, repeats, radius_mm)
    progress("", 1.0)
    everything = np.array(candidates[0].times_ms)
    results = tuple(
        TermResult(
            c.variant,
            summarise(c.scores),
            float(np.median(c.times_ms)),
            float(np.median(everything - c.times_ms)),
            c.calibration_s,
        )
        for c in candidates
    )
    return Ablation(session.folder.resolve().name, results, repeats, refused)


def read_presses(session: Session, radius_mm: float) -> list[TruePress]:
    """Read all presses of a session with true depth, so that missing files are reported first.

    Parameters
    ----------
    session : Session
        With ``presses/truth.csv`` and ``truth/*.npz``.
    radius_mm : float
        Radius within which each press must show its plateau.

    Raises
    ------
    InputError
        If a press has no image, no truth or no plateau in view.
    """
    folder = session.folder / "presses"
    presses = []
    for row in read_truth(folder / "truth.csv").rows:
        image = session.image(folder / row.file)
        require_colour(image, where=str(folder / row.file))
        truth = read_true_depth((session.folder / "truth" / row.file).with_suffix(".npz"))
        press = TruePress(row, image.rgb, truth)
        _score(press, truth, radius_mm)
        presses.append(press)
    return presses


def _score(press: TruePress, found: TrueDepth | HeightMap, radius_mm: float) -> DepthScore:
    height_mm = press.row.truth.height_mm
    try:
        return score_depth(
            np.asarray(found.depth_mm, np.float32),
            found.x_mm,
            found.y_mm,
            press.truth,
            height_mm=height_mm,
            radius_mm=radius_mm,
        )
    except ValueError as error:
        raise InputError(
            tr("its true depth has no plateau of {h:g} mm within {r:g} mm of the centre").format(
                h=height_mm, r=radius_mm
            ),
            where=press.row.file,
            advice=tr("Correct the height in truth.csv, or remove the row"),
        ) from error


def _take_in_turn(
    candidates: Sequence[_Candidate], press: TruePress, repeats: int, radius_mm: float
) -> None:
    """Reconstruct one press by every candidate, round by round."""
    for repeat in range(repeats):
        for candidate in candidates:
            begin = time.process_time()
            found = candidate.reconstruct.depth(press.rgb, normals=False)
            candidate.times_ms.append(1e3 * (time.process_time() - begin))
            if repeat == 0:
                candidate.scores.append(_score(press, found, radius_mm))


def _calibrated(
    session: Session, variants: Sequence[Variant], workers: int, progress: Progress
) -> tuple[list[_Candidate], tuple[tuple[Variant, str], ...]]:
    """Calibrate the stages once, and refine them for every requested set of terms.

    Without a term that a sensor needs, the refinement may end at LEDs that no reconstruction
    accepts. Such variants are returned with the reason.
    """
    asked = {variant.calibration for variant in variants}
    whole = 1 + len(asked)
    results = StageResults()
    stages = stages_of("paper")
    for number, stage in enumerate(stages):
        progress(stage.value, CALIBRATING * number / len(stages) / whole)
        results = run_stage(stage, session, results)
    paper = assemble(session, results, model="paper").calibration
    made: dict[CalibrationTerms, tuple[Calibration, float]] = {}
    candidates: list[_Candidate] = []
    refused: list[tuple[Variant, str]] = []
    for variant in variants:
        terms = variant.calibration
        if terms not in made:
            progress(variant.label, CALIBRATING * (1 + len(made)) / whole)
            begin = time.process_time()
            refined = bare_calibration(session, refine_with(session.sensor, results, terms=terms))
            made[terms] = refined, time.process_time() - begin
        calibration, seconds = made[terms]
        if variant.model == "paper":
            calibration, seconds = paper, float("nan")
        try:
            reconstruct = Reconstructor(
                calibration, model=variant.model, terms=variant.terms, workers=workers
            )
        except InputError as error:
            if variant is EVERYTHING:
                raise
            refused.append((variant, str(error)))
        else:
            candidates.append(_Candidate(variant, reconstruct, seconds))
    return candidates, tuple(refused)
