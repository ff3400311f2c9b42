"""Time saved by each rule that skips a step, and its largest change of the depth.

Each rule is switched off in turn, for every effort, on the same frames. Runs with and without the
rule alternate, so that a slow phase of the machine affects both.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.near_light.settings import SETTINGS, Settings
from gelpolight_core.reconstruction.near_light.solver import NearLightDepth, NearLightSolver
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
REPEATS = 2
WORTH_PERCENT = 3.0
"""A rule must save this share somewhere; otherwise it is not worth keeping."""
EMPTY, SHALLOW, PRESSED = "empty", "shallow", "pressed"


@dataclass(frozen=True, slots=True)
class Frame:
    """An image, and the depth of its contact.

    Attributes
    ----------
    kind : str
        ``empty``, ``shallow`` (below 0.05 mm) or ``pressed``.
    raw : (height, width, 3)
        As the camera delivers it.
    """

    kind: str
    raw: NDArray[Any]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule, and how it is switched off.

    Attributes
    ----------
    name, label : str
        For files and people.
    kind : str
        Kind of frames for which the rule is intended.
    without : callable
        The settings of an effort without the rule.
    everywhere : bool
        Whether the whole field is solved without it.
    """

    name: str
    label: str
    kind: str
    without: Callable[[Settings], Settings] = lambda settings: settings
    everywhere: bool = False


RULES = (
    Rule("empty", tr("all after contact detection, nothing pressed"), EMPTY, everywhere=True),
    Rule("beside", tr("the field beside the contact"), PRESSED, everywhere=True),
    Rule(
        "second_round",
        tr("second near-light round of a shallow press"),
        SHALLOW,
        lambda settings: replace(settings, shallow_mm=0.0),
    ),
    Rule(
        "settled",
        tr("Gauss-Newton steps of settled nodes"),
        PRESSED,
        lambda settings: replace(settings, settled=0.0),
    ),
)


@dataclass(frozen=True, slots=True)
class RuleFigure:
    """One rule at one effort on one sensor.

    Attributes
    ----------
    sensor, rule, label, effort : str
        What was measured.
    with_ms, without_ms : float
        Median time of a frame with and without the rule.
    change_um, change_rms_um : float
        Largest change of the depth, and its root mean square, over all frames.
    frames : int
        How many were measured.
    """

    sensor: str
    rule: str
    label: str
    effort: str
    with_ms: float
    without_ms: float
    change_um: float
    change_rms_um: float
    frames: int

    @property
    def saved_percent(self) -> float:
        """Share of the time without the rule that it saves."""
        return 100.0 * (1.0 - self.with_ms / self.without_ms)


def measure_rules(
    sensor: str,
    calibration: Calibration,
    frames: Sequence[Frame],
    *,
    repeats: int = REPEATS,
    workers: int = 2,
    progress: Progress | None = None,
) -> tuple[RuleFigure, ...]:
    """Measure every rule for which there is a frame, at every effort.

    Parameters
    ----------
    sensor : str
        Its name.
    calibration : Calibration
        For the full model.
    frames : sequence of Frame
        Of the calibration's size.
    repeats : int, optional
        How often each frame is timed.
    workers : int, optional
        Threads.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.
    """
    assert calibration.full is not None
    usual = NearLightSolver(calibration, calibration.full, workers=workers)
    found = []
    for number, rule in enumerate(RULES):
        mine = [frame.raw for frame in frames if frame.kind == rule.kind]
        if not mine:
            continue
        settings = {effort: rule.without(SETTINGS[effort]) for effort in EFFORTS}
        other = NearLightSolver(calibration, calibration.full, workers=workers, settings=settings)
        for effort in EFFORTS:
            if progress is not None:
                progress(rule.label, number / len(RULES))
            found.append(_figure(sensor, rule, effort, (usual, other), mine, repeats))
    return tuple(found)


def worthless(figures: Sequence[RuleFigure]) -> tuple[str, ...]:
    """Return the labels of rules that save less than `WORTH_PERCENT` at every effort and sensor."""
    best: dict[str, float] = {}
    for figure in figures:
        best[figure.label] = max(best.get(figure.label, -np.inf), figure.saved_percent)
    return tuple(label for label, saved in best.items() if saved < WORTH_PERCENT)


def rule_table(figures: Sequence[RuleFigure]) -> str:
    """Return the figures as lines of text."""
    lines = [
        f"{tr('sensor'):<16}{tr('left out'):<46}{tr('effort'):<10}{tr('with ms'):>9}"
        f"{tr('without'):>9}{tr('saved %'):>9}{tr('change um'):>11}{tr('RMS'):>7}"
    ]
    lines += [
        f"{f.sensor:<16}{f.label:<46}{f.effort:<10}{f.with_ms:9.1f}{f.without_ms:9.1f}"
        f"{f.saved_percent:9.0f}{f.change_um:11.2f}{f.change_rms_um:7.2f}"
        for f in figures
    ]
    return "\n".join(lines)


def _figure(
    sensor: str,
    rule: Rule,
    effort: str,
    solvers: tuple[NearLightSolver, NearLightSolver],
    frames: Sequence[NDArray[Any]],
    repeats: int,
) -> RuleFigure:
    usual, other = solvers
    times: tuple[list[float], list[float]] = ([], [])
    largest, squares = 0.0, []
    for frame in frames:
        for turn in range(1 + repeats):
            found = []
            for solver, times_ms, everywhere in (
                (usual, times[0], False),
                (other, times[1], rule.everywhere),
            ):
                begin = time.perf_counter()
                found.append(_depth(solver, frame, effort, everywhere))
                if turn:
                    times_ms.append(1e3 * (time.perf_counter() - begin))
            if turn == 0:
                change = 1e3 * np.abs(found[0].depth_mm - found[1].depth_mm)
                largest = max(largest, float(change.max()))
                squares.append(float(np.mean(change**2)))
    with_ms, without_ms = (float(np.median(t)) for t in times)
    return RuleFigure(
        sensor,
        rule.name,
        rule.label,
        effort,
        with_ms,
        without_ms,
        largest,
        float(np.sqrt(np.mean(squares))),
        len(frames),
    )


def _depth(
    solver: NearLightSolver, frame: NDArray[Any], effort: str, everywhere: bool
) -> NearLightDepth:
    return solver.depth(frame, effort=effort, normals=False, everywhere=everywhere)
