"""Which terms a sensor needs, on linear presses of known parameters."""

from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from gelpolight_core.calibration.refinement_kernel import CORRELATION
from gelpolight_core.calibration.refinement_parameters import (
    DECAY,
    GLOSS,
    INTERREFLECTION,
    ROUGHNESS,
    Parameter,
)
from gelpolight_core.calibration.term_selection import LinearTerms, needed_terms
from gelpolight_core.light.coating_stretch import LOSS
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES

SHARED = (DECAY, GLOSS, ROUGHNESS, INTERREFLECTION, LOSS)
CANDIDATES = ("gloss", "interreflection", "stretch")
NEUTRAL = np.array([0.7, 0.0, 0.5, 0.0, 0.0])
BALL = ("ball_x_mm", "ball_y_mm", "ball_depth_mm")
NOISE = 0.05
LIGHT = 0.02
"""Share of the light that a residual of 1 stands for."""


@dataclass
class LinearPresses:
    """A joint refinement whose residuals are linear in all parameters."""

    slopes: list[np.ndarray]
    seen: list[np.ndarray]
    prior: np.ndarray
    stated: tuple[str, ...] = ()

    @property
    def presses(self) -> list[SimpleNamespace]:
        return [SimpleNamespace(weight=np.full(b.size, CORRELATION / LIGHT)) for b in self.seen]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        of_ball = partial(Parameter, name="", start=0.0)
        balls = (of_ball(key, press=k) for k in range(len(self.slopes)) for key in BALL)
        return (*SHARED, *balls)

    @property
    def free(self) -> np.ndarray:
        return np.ones(len(self.parameters), bool)

    @property
    def shared(self) -> np.ndarray:
        return np.array([parameter.press is None for parameter in self.parameters])

    def residuals(self, x: np.ndarray) -> list[np.ndarray]:
        return [a @ x - b for a, b in zip(self.slopes, self.seen, strict=True)]

    def priors(self, x: np.ndarray) -> np.ndarray:
        return self.prior @ x

    def jacobian(self, _x: np.ndarray) -> np.ndarray:
        return np.concatenate([*self.slopes, self.prior])

    def by_stated(self, x: np.ndarray) -> np.ndarray:
        return np.zeros((len(self.jacobian(x)), 0))

    def solution(self) -> np.ndarray:
        seen = np.concatenate([*self.seen, np.zeros(len(self.prior))])
        return np.linalg.lstsq(self.jacobian(NEUTRAL), seen, rcond=None)[0]


def presses(
    count: int, *, alike: bool = False, by_ball: bool = False, **values: float
) -> LinearPresses:
    """Return presses of a sensor with some values; the others are neutral.

    Parameters
    ----------
    count : int
        Number of presses.
    alike : bool
        Whether gloss and stretch change the light in nearly the same way.
    by_ball : bool
        Whether the place of a ball explains all that a stretch changes.
    **values
        By the keys of the parameters.
    """
    random = np.random.default_rng(11)
    x = np.array([values.get(p.key, v) for p, v in zip(SHARED, NEUTRAL, strict=True)])
    of_balls = len(SHARED), len(BALL) * count
    slopes, seen = [], []
    for k in range(count):
        a = np.zeros((60, sum(of_balls)))
        own = slice(of_balls[0] + len(BALL) * k, of_balls[0] + len(BALL) * (k + 1))
        a[:, : of_balls[0]], a[:, own] = random.normal(size=(60, 5)), random.normal(size=(60, 3))
        if alike:
            a[:, 4] = a[:, 1] + 0.01 * a[:, 4]
        if by_ball:
            a[:, 4] = a[:, own] @ [1.0, 2.0, -1.0]
        slopes.append(a)
        seen.append(a[:, : of_balls[0]] @ x + NOISE * random.normal(size=60))
    prior = np.zeros((1, sum(of_balls)))
    prior[0, 0] = 1e-3
    return LinearPresses(slopes, seen, prior)


def chosen(problem: LinearPresses) -> set[str]:
    found = needed_terms(LinearTerms(problem, problem.solution()), CANDIDATES)
    return {key for key, one in found.items() if one.used}


def test_a_term_that_matters_is_chosen_and_no_other():
    problem = presses(8, stretch_loss=0.2, interreflection=0.2)
    assert chosen(problem) == {"stretch", "interreflection"}
    found = needed_terms(LinearTerms(problem, problem.solution()), CANDIDATES)
    for key in ("stretch", "interreflection"):
        assert found[key].gain > 3.0 * found[key].scatter > 0.0
    assert found["gloss"].gain < 3.0 * found["gloss"].scatter


def test_a_sensor_with_nothing_special_gets_no_term():
    assert chosen(presses(8)) == set()


def test_of_two_terms_that_do_the_same_only_one_is_chosen():
    """The place of a value is not split between them."""
    assert len(chosen(presses(8, alike=True, gloss=0.15, roughness=0.5))) == 1


def test_what_the_place_of_a_ball_explains_needs_no_term():
    assert chosen(presses(8, by_ball=True, stretch_loss=0.3)) == set()


@pytest.mark.parametrize(("loss", "expected"), [(0.0, set()), (0.02, set()), (0.5, {"stretch"})])
def test_of_too_few_presses_none_is_held_out(loss, expected):
    """Then a term must lower their residuals by more than a square of standard deviations."""
    few = presses(LEAST_PRESSES - 1, stretch_loss=loss)
    assert chosen(few) == expected


@pytest.mark.parametrize("used", [(), ("stretch",), CANDIDATES])
def test_the_linear_problem_leaves_what_a_fit_without_each_press_leaves(used):
    problem = presses(5, stretch_loss=0.02, gloss=0.01)
    x = problem.solution()
    columns = {"gloss": [1, 2], "interreflection": [3], "stretch": [4]}
    free = [0, *(c for key in used for c in columns[key])]
    fixed = [c for c in range(5) if c not in free]
    expected = []
    for k, (a, seen) in enumerate(zip(problem.slopes, problem.seen, strict=True)):
        balls = [c for c in range(5, a.shape[1]) if not 5 + 3 * k <= c < 8 + 3 * k]
        others = np.concatenate([s for i, s in enumerate(problem.slopes) if i != k])
        target = np.concatenate([b for i, b in enumerate(problem.seen) if i != k])
        rows = np.concatenate([others, problem.prior])
        goal = np.append(target, 0.0) - rows[:, fixed] @ NEUTRAL[fixed]
        fit = np.linalg.lstsq(rows[:, [*free, *balls]], goal, rcond=None)[0]
        # Only its own ball is fitted to the press that is judged.
        rest = seen - a[:, fixed] @ NEUTRAL[fixed] - a[:, free] @ fit[: len(free)]
        own = a[:, 5 + 3 * k : 8 + 3 * k]
        expected.append(np.sum((rest - own @ np.linalg.lstsq(own, rest, rcond=None)[0]) ** 2))
    # Large residuals count less, by 0.2 % for this noise.
    left = LinearTerms(problem, x).left(used)
    np.testing.assert_allclose(left, expected, rtol=0.01)


@pytest.mark.parametrize("key", ["stretch", "gloss"])
def test_a_term_is_worth_the_light_that_changes_between_fits_with_and_without_it(key):
    """Of a term in use, and of one that is left out."""
    problem, used = presses(6, stretch_loss=0.05), {"stretch"}
    columns = {"gloss": [1, 2], "stretch": [4]}
    light = []
    for keys in (used | {key}, used - {key}):
        free = [0, *(c for k in keys for c in columns[k]), *range(5, 5 + 3 * 6)]
        slopes, x = np.concatenate(problem.slopes), np.append(NEUTRAL, np.zeros(18))
        fixed = [c for c in range(5) if c not in free]
        x[fixed] = NEUTRAL[fixed]
        goal = np.concatenate(problem.seen) - slopes[:, fixed] @ x[fixed]
        x[free] = np.linalg.lstsq(slopes[:, free], goal, rcond=None)[0]
        light.append(LIGHT * slopes @ x)
    expected = np.sqrt(np.mean((light[0] - light[1]) ** 2))
    found = LinearTerms(problem, problem.solution()).evidence(key, used)
    assert found.worth == pytest.approx(expected, rel=0.02)
