"""Benefit and cost of each term of the full model: each term is left out in turn.

    python -m tests.studies.ablation SESSION

SESSION holds presses with their true depth. Terms of a frame are left out of the reconstruction
only; terms of the membrane and the LEDs are left out of the joint refinement, so that the other
terms can compensate as far as possible. Times are processor times of all threads together. Every
press is reconstructed by all variants in turn; the cost of a term is the median of the differences.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
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
from gelpolight_core.calibration.refinement_parameters import (
    CURVED,
    GLOSSY,
    LEDS,
    OPTIONAL,
    REFLECTING,
)
from gelpolight_core.lab.depth_score import score_depth, scored_radius_mm
from gelpolight_core.light.light_terms import LIGHT_TERMS
from gelpolight_core.light.parameter import Term
from gelpolight_core.reconstruction.height_map import COARSE, HeightMap
from gelpolight_core.reconstruction.near_light import ratio_sampler
from gelpolight_core.reconstruction.near_light import solver as near_light
from gelpolight_core.reconstruction.near_light.boundary_condition import BoundaryCondition
from gelpolight_core.reconstruction.near_light.kernel_structures import (
    HIDDEN,
    JUDGED,
    RatioImage,
)
from gelpolight_core.reconstruction.near_light.ratio_sampler import BEYOND_FINITE, RatioSampler
from gelpolight_core.reconstruction.near_light.region_solution import SolvedRegion
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
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
Inner = Callable[..., Any]


def _function(name: str, change: Inner) -> AbstractContextManager[Any]:
    """Replace a function that the solver calls by `change`, which gets the function first."""
    return patch.object(near_light, name, partial(change, getattr(near_light, name)))


def _method(name: str, change: Inner) -> AbstractContextManager[Any]:
    """Replace a method of the solver by `change`, which gets the method first."""
    inner = getattr(NearLightSolver, name)
    return patch.object(NearLightSolver, name, lambda *given: change(inner, *given))


def _plain(inner: Inner, slope_x: Any, slope_y: Any, weight: Any, **options: Any) -> Any:
    return inner(slope_x, slope_y, np.ones_like(weight), **options | {"hold": None})


def _at_depth_0(inner: Inner, solved: SolvedRegion, *given: Any) -> None:
    # Nodes infinitely far apart: no ray reaches the next one.
    inner(solved._replace(scale=solved.scale._replace(pitch_mm=np.inf)), *given)


def _with_dark(
    inner: Inner, solver: NearLightSolver, task: Any, factor: int, image: RatioImage, *given: Any
) -> Any:
    """Solve as if the surface had shown that no light is hidden."""
    hidden = np.uint8(HIDDEN | HIDDEN << 1 | HIDDEN << 2)
    marks = (image.marks | np.uint8(JUDGED)) & ~hidden
    return inner(solver, task, factor, image._replace(marks=marks), *given)


def _parallel(inner: Inner, solver: NearLightSolver, task: Any, factor: int, *given: Any) -> Any:
    """Take the slopes of the normals, as along parallel rays."""
    slopes, scale = inner(solver, task, factor, *given), solver.maps.scale(factor)
    down = -np.sqrt(1.0 - slopes.normal_x**2 - slopes.normal_y**2)
    slopes.slope_x[:], slopes.slope_y[:] = slopes.normal_x / down, slopes.normal_y / down
    if scale.rest is not None:
        _, rest_x, rest_y = scale.rest[(slice(None), *task.region.window(COARSE // factor))]
        slopes.slope_x[:] += rest_x
        slopes.slope_y[:] += rest_y
    return slopes


FIXED_BOUNDARY = patch.object(near_light, "find_boundary", lambda *_: BoundaryCondition())
TERMS: dict[str, tuple[AbstractContextManager[Any], ...]] = {
    "all terms": (),
    "light for depth 0 only": (patch.object(near_light, "NEAR_LIGHT_ROUNDS", 0),),
    "near light: 1 coarse round": (patch.object(near_light, "NEAR_LIGHT_ROUNDS", 1),),
    "near light: 3 coarse rounds": (patch.object(near_light, "NEAR_LIGHT_ROUNDS", 3),),
    "slopes without ray correction": (_method("_slopes", _parallel),),
    "positions at depth 0": (_function("place_region", _at_depth_0),),
    "dark channels used": (_method("_slopes", _with_dark),),
    "saturated channels used": (patch.object(ratio_sampler, "SATURATED", BEYOND_FINITE),),
    "plain sine transform, no weights": (_function("integrate_weighted", _plain), FIXED_BOUNDARY),
    "boundary fixed at depth 0": (FIXED_BOUNDARY,),
    "uniform areas not averaged": (patch.object(ratio_sampler, "denoise_ratio", lambda *_: None),),
    "images not sharpened": (patch.object(RatioSampler, "_sharpen", lambda *_: None),),
}
"""The variants of a frame's reconstruction, and what each replaces in the solver."""
REFINEMENTS: dict[str, Term] = {
    "no interreflection": REFLECTING,
    "no glossy lobe": GLOSSY,
    "no reflectance curves": CURVED,
    "LED positions from mirror spots": LEDS,
    **{f"no {term.name}": term for term in LIGHT_TERMS},
}
"""The term that each variant of the joint refinement has not."""
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
    for name, solver in solvers.items():
        _depth(name, solver, presses[0])  # prepares maps and kernels
    for n, press in enumerate(presses):
        for k, (name, solver) in enumerate(solvers.items()):
            begin = time.process_time()
            found = _depth(name, solver, press)
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


def _depth(name: str, solver: Reconstructor, press: TruePress) -> HeightMap:
    """Reconstruct a press by a variant."""
    with ExitStack() as stack:
        for change in TERMS.get(name, ()):
            stack.enter_context(change)
        return solver.depth(press.frame, normals=False)


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
                solvers[name] = Reconstructor(whole)
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
    others = tuple(key for key in OPTIONAL if key != REFINEMENTS[name].key)
    with patch.object(joint_refinement, "OPTIONAL", others):
        return full_calibration(session, results)


if __name__ == "__main__":
    own = read_session(folder_named())
    show(ablate(own, stage_results(own), true_presses(own)))
