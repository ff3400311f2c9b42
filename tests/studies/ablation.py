"""Benefit and cost of each term of the full model: each term is left out in turn.

    python -m tests.studies.ablation SESSION

SESSION holds presses with their true depth. Terms of a frame are left out of the reconstruction
only; terms of the membrane and the LEDs are left out of the joint refinement, so that the other
terms can compensate as far as possible. Times are processor times of all threads together. Every
press is reconstructed by all variants in turn; the cost of a term is the median of the differences.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration import joint_refinement
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS
from gelpolight_core.calibration.project import assemble
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.recipes import PAPER as PAPER_RECIPE
from gelpolight_core.lab.depth_score import score_depth, scored_radius_mm
from gelpolight_core.reconstruction.model_terms import ModelTerms
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session import Session, read_session
from tests.studies.presses import (
    TruePress,
    folder_named,
    full_calibration,
    show,
    stage_results,
    true_presses,
)

PAPER = "paper's model"
TERMS = {
    "all terms": ModelTerms(),
    "light for depth 0 only": ModelTerms(near_light_rounds=0),
    "near light: 1 coarse round": ModelTerms(near_light_rounds=1),
    "near light: 3 coarse rounds": ModelTerms(near_light_rounds=3),
    "slopes without ray correction": ModelTerms(ray_true_slopes=False),
    "positions at depth 0": ModelTerms(true_positions=False),
    "dark channels used": ModelTerms(shadows=False),
    "saturated channels used": ModelTerms(saturation=False),
    "plain sine transform, no weights": ModelTerms(weights=False),
    "boundary fixed at depth 0": ModelTerms(free_boundary=False),
    "uniform areas not averaged": ModelTerms(denoising=False),
    "images not sharpened": ModelTerms(sharpening=False),
}
GLOSS = 10
"""Place of the glossy share among the parameters of the joint refinement; the roughness follows."""
NEVER = (0.0, np.inf)
"""Losses of which the second never wins."""
Inner = Callable[..., Any]


def _without_gloss(inner: Inner, *given: Any, **options: Any) -> Any:
    start, free = inner(*given, **options)
    start[GLOSS], free[GLOSS : GLOSS + 2] = 0.0, False
    return start, free


REFINEMENTS: dict[str, tuple[str, Inner]] = {
    "no interreflection": ("_first_light", lambda _inner, *_: None),
    "no glossy lobe": ("_start", _without_gloss),
    "no reflectance curves": ("_held_out", lambda inner, *given: (inner(*given)[0], NEVER)),
    "LED positions from mirror spots": (
        "_held_out",
        lambda inner, *given: (NEVER, inner(*given)[1]),
    ),
}
"""A function of the joint refinement that is replaced, and by what."""
RAW = "crosstalk not removed"
VARIANTS = (*TERMS, *REFINEMENTS, RAW, PAPER)


def ablate(
    session: Session,
    results: StageResults,
    presses: list[TruePress],
    names: Sequence[str] = VARIANTS,
) -> Iterator[dict[str, Any]]:
    """Yield one row for each variant that a reconstruction accepts; the first has all terms."""
    solvers = _solvers(session, results, names)
    radius_mm = scored_radius_mm(session.sensor)
    errors, times = (
        np.zeros((len(presses), len(solvers), 3)),
        np.zeros((len(presses), len(solvers))),
    )
    for solver in solvers.values():
        solver.depth(presses[0].frame, normals=False)  # prepares maps and kernels
    for n, press in enumerate(presses):
        for k, solver in enumerate(solvers.values()):
            begin = time.process_time()
            found = solver.depth(press.frame, normals=False)
            times[n, k] = 1e3 * (time.process_time() - begin)
            nodes = found.depth_mm, found.x_mm, found.y_mm
            options = {"height_mm": press.height_mm, "radius_mm": radius_mm}
            score = score_depth(*nodes, press.truth, **options)
            errors[n, k] = np.abs([score.height_percent, score.size_percent, score.rms_um])
    means = errors.mean(axis=0)
    for k, name in enumerate(solvers):
        yield {
            "instead": name,
            "height %": means[k, 0],
            "size %": means[k, 1],
            "RMS um": means[k, 2],
            "worst um": errors[:, k, 2].max(),
            "worth um": means[k, 2] - means[0, 2],
            "frame ms": float(np.median(times[:, k])),
            "cost ms": float(np.median(times[:, 0] - times[:, k])),
        }


def _solvers(
    session: Session, results: StageResults, names: Sequence[str]
) -> dict[str, Reconstructor]:
    """Return the reconstructor of each variant; one that no reconstruction accepts is named."""
    whole = full_calibration(session, results)
    solvers = {}
    for name in names:
        try:
            if name == PAPER:
                paper = assemble(PAPER_RECIPE, session, results).calibration
                solvers[name] = Reconstructor(paper, model="paper")
            elif name in TERMS:
                solvers[name] = Reconstructor(whole, terms=TERMS[name])
            else:
                solvers[name] = Reconstructor(_refined(session, results, name))
        except InputError as error:
            print(f"{name}: {error}")
    return solvers


def _refined(session: Session, results: StageResults, name: str) -> Calibration:
    """Refine without a term of the membrane or the LEDs."""
    if name == RAW:
        lights = results[LIGHTS]
        none = replace(lights.crosstalk, matrix=np.eye(3))
        results = results.having(LIGHTS, replace(lights, crosstalk=none))
        return full_calibration(session, results)
    function, change = REFINEMENTS[name]
    with patch.object(
        joint_refinement, function, partial(change, getattr(joint_refinement, function))
    ):
        return full_calibration(session, results)


if __name__ == "__main__":
    own = read_session(folder_named())
    show(ablate(own, stage_results(own), true_presses(own)))
