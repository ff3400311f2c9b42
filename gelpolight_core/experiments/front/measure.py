"""Error against run time of each method.

Errors are differences from the true depth, which no method
uses. Every press is timed with all methods in turn, so that a slow phase of the machine affects
all. A method that fails or refuses is a gap with its reason.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from gelpolight_core.errors import InputError
from gelpolight_core.experiments.front.methods import Method, Slopes, Solve
from gelpolight_core.experiments.front.scene import Press, Scene
from gelpolight_core.experiments.orders import Order, fit_order
from gelpolight_core.measurement.score import DepthScore, TrueDepth, score_depth, scored_radius_mm
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
REPEATS = 2
BUDGET_S = 2.0
"""A method that has run for this time at one size is not repeated. Each press is timed at least
once."""
MOST_WIDTH = {"precision": 640, "rival_wrong": 1280}
"""Largest image width of families for which larger images give no new information."""
TOUCHED_MM = 0.02
WORTH = 0.01


@dataclass(frozen=True, slots=True)
class Point:
    """One method at one image size.

    Attributes
    ----------
    sensor, method, label, family : str
        The method and sensor.
    width : int
        Of the image, in pixels.
    megapixels : float
        Of the image.
    pitch_mm : float
        Of the grid.
    median_ms, p95_ms : float or None
        Of a frame, over all presses; None for a gap.
    rms_um, normal_deg, height_percent, size_percent : float or None
        Mean absolute errors over the presses: depth (RMS), direction of the normal where the
        membrane is pressed (RMS), plateau height, size at half height.
    rms_low_um, rms_high_um : float or None
        Quartiles of the depth error over the presses.
    presses : int
        How many there were.
    gap : str
        The reason of a gap; empty if there is none.
    """

    sensor: str
    method: str
    label: str
    family: str
    width: int
    megapixels: float
    pitch_mm: float
    median_ms: float | None = None
    p95_ms: float | None = None
    rms_um: float | None = None
    normal_deg: float | None = None
    height_percent: float | None = None
    size_percent: float | None = None
    rms_low_um: float | None = None
    rms_high_um: float | None = None
    presses: int = 0
    gap: str = ""


@dataclass(slots=True)
class _Run:
    """A method at work on one sensor."""

    method: Method
    solve: Solve | None
    gap: str = ""
    times_ms: list[float] = field(default_factory=list)
    scores: list[DepthScore] = field(default_factory=list)
    angles_deg: list[float] = field(default_factory=list)


def measure_scene(
    scene: Scene,
    presses: Sequence[Press],
    methods: Sequence[Method],
    *,
    repeats: int = REPEATS,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure every method on the presses of a calibrated sensor.

    Parameters
    ----------
    scene : Scene
        The sensor at one image size.
    presses : sequence of Press
        At that size.
    methods : sequence of Method
        From :func:`~gelpolight_core.experiments.front.methods.methods`.
    repeats : int, optional
        How often each press is timed, after a first run for the error.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.
    """
    progress = progress or (lambda _what, _share: None)
    runs = []
    for number, method in enumerate(methods):
        progress(method.label, 0.2 * number / len(methods))
        runs.append(_ready(method, scene))
    grid = scene.full.table.grid
    radius_mm = scored_radius_mm(scene.full.sensor)
    total = (1 + repeats) * len(presses)
    for turn in range(total):
        press, round_ = presses[turn % len(presses)], turn // len(presses)
        progress(
            tr("{file}, round {n}").format(file=press.name, n=round_), 0.2 + 0.8 * turn / total
        )
        for run in runs:
            if round_ == 0:
                _score(run, press, grid, radius_mm)
            elif round_ == 1 or sum(run.times_ms) < 1e3 * BUDGET_S:
                _time(run, press)
    progress("", 1.0)
    return tuple(_point(run, scene) for run in runs)


def _ready(method: Method, scene: Scene) -> _Run:
    most = MOST_WIDTH.get(method.family)
    if most is not None and scene.full.camera.width > most:
        return _Run(method, None, tr("measured up to {n} pixels of width").format(n=most))
    try:
        return _Run(method, method.make(scene))
    except InputError as error:
        return _Run(method, None, str(error))


def _time(run: _Run, press: Press) -> None:
    if run.solve is not None:
        begin = time.perf_counter()
        run.solve(press.frame)
        run.times_ms.append(1e3 * (time.perf_counter() - begin))


def _score(run: _Run, press: Press, grid: MembraneGrid, radius_mm: float) -> None:
    """Score a method on a press; a refusal makes a gap."""
    if run.solve is None:
        return
    try:
        depth, slopes = run.solve(press.frame)
        score = score_depth(
            np.asarray(depth, np.float32),
            grid.x_mm,
            grid.y_mm,
            press.truth,
            height_mm=press.height_mm,
            radius_mm=radius_mm,
        )
    except (InputError, ValueError) as error:
        run.solve, run.gap = None, str(error)
        return
    run.scores.append(score)
    run.angles_deg.append(normal_error_deg(slopes, grid, press.truth, radius_mm))


def normal_error_deg(
    slopes: Slopes, grid: MembraneGrid, truth: TrueDepth, radius_mm: float
) -> float:
    """Return the root mean square angle between found and true normals, where pressed.

    Parameters
    ----------
    slopes : two (rows, columns)
        Found d(depth)/dx and d(depth)/dy on the grid.
    grid : MembraneGrid
        Their nodes.
    truth : TrueDepth
        What was pressed; only nodes deeper than `TOUCHED_MM` count.
    radius_mm : float
        Only nodes within this radius count.
    """
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    down, across = (np.asarray(g) for g in np.gradient(truth.depth_mm, pitch))
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    column = ((x - truth.x_mm[0]) / pitch).astype(np.float32)
    row = ((y - truth.y_mm[0]) / pitch).astype(np.float32)
    true = np.stack([truth.depth_mm, across, down], axis=-1)
    seen = cv2.remap(true, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    depth, true_x, true_y = (np.asarray(seen[..., k], np.float64) for k in range(3))
    counts = (depth > TOUCHED_MM) & (np.hypot(x, y) < radius_mm)
    found_x, found_y = (np.asarray(s, np.float64)[counts] for s in slopes)
    tx, ty = true_x[counts], true_y[counts]
    cosine = (found_x * tx + found_y * ty + 1.0) / np.sqrt(
        (found_x**2 + found_y**2 + 1.0) * (tx**2 + ty**2 + 1.0)
    )
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return float(np.sqrt(np.mean(angle**2))) if angle.size else math.nan


def _point(run: _Run, scene: Scene) -> Point:
    camera, method = scene.full.camera, run.method
    common: dict[str, Any] = {
        "sensor": scene.sensor,
        "method": method.name,
        "label": method.label,
        "family": method.family,
        "width": camera.width,
        "megapixels": camera.width * camera.height / 1e6,
        "pitch_mm": scene.full.table.grid.pitch_mm,
    }
    if run.solve is None or not run.times_ms:
        return Point(**common, gap=run.gap)
    errors = np.abs([(s.rms_um, s.height_percent, s.size_percent) for s in run.scores])
    rms, height, size = errors.mean(axis=0).tolist()
    low, high = np.percentile(errors[:, 0], [25.0, 75.0]).tolist()
    return Point(
        **common,
        median_ms=float(np.median(run.times_ms)),
        p95_ms=float(np.percentile(run.times_ms, 95)),
        rms_um=rms,
        normal_deg=float(np.mean(run.angles_deg)),
        height_percent=height,
        size_percent=size,
        rms_low_um=low,
        rms_high_um=high,
        presses=len(run.scores),
    )


def measured(point: Point) -> tuple[float, float]:
    """Return time (ms) and depth error (um) of a point that is not a gap."""
    assert point.median_ms is not None and point.rms_um is not None
    return point.median_ms, point.rms_um


def pareto_front(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the points of one sensor and size that no other exceeds in both time and depth error.

    The fastest comes first. A slower point must be better by `WORTH`: smaller differences are
    noise.
    """
    known = sorted(
        (p for p in points if p.median_ms is not None and p.rms_um is not None),
        key=measured,
    )
    front: list[Point] = []
    for point in known:
        if not front or measured(point)[1] < (1.0 - WORTH) * measured(front[-1])[1]:
            front.append(point)
    return tuple(front)


def fronts(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the front of every sensor and size."""
    groups = dict.fromkeys((p.sensor, p.width) for p in points)
    return tuple(
        point
        for group in groups
        for point in pareto_front([p for p in points if (p.sensor, p.width) == group])
    )


def observed_order(points: Sequence[Point]) -> Order | None:
    """Return the order of the depth error of one method on one sensor with the pitch.

    None with fewer than three sizes.
    """
    known = [p for p in points if p.rms_um is not None]
    return fit_order([p.pitch_mm for p in known], [p.rms_um or 0.0 for p in known])


def recommended(
    points: Sequence[Point], *, rate_hz: float | None = None, rms_um: float | None = None
) -> Point | None:
    """Return the recommended method; None if none is fast and accurate enough.

    With a required error it is the fastest, without one the most accurate.

    Parameters
    ----------
    points : sequence of Point
        Of one sensor and size.
    rate_hz : float, optional
        Required frames per second; the 95th percentile of the time must meet it.
    rms_um : float, optional
        Largest accepted depth error.
    """
    known = [p for p in points if p.p95_ms is not None and p.rms_um is not None]
    if rate_hz is not None:
        known = [p for p in known if (p.p95_ms or 0.0) * rate_hz <= 1e3]
    if rms_um is not None:
        known = [p for p in known if (p.rms_um or 0.0) <= rms_um]
    if rms_um is not None:
        return min(known, key=measured, default=None)
    return min(known, key=lambda p: measured(p)[::-1], default=None)
