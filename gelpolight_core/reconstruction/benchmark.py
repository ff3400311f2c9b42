"""Where the time of a frame goes, beside the plain version and the cost of copying the bytes."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.full import as_linear, coarse_depth, shaded_field
from gelpolight_core.reconstruction.near_light import solve_near_light
from gelpolight_core.reconstruction.placement import place_on_grid
from gelpolight_core.reconstruction.plain import plain_depth, plain_slopes
from gelpolight_core.reconstruction.plan import Plan
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.weighted import integrate_weighted

LIBRARIES = ("numpy", "scipy", "numba", "opencv-contrib-python-headless")


@dataclass(frozen=True, slots=True)
class Timing:
    """Times of one step over all repeats, in ms, and the bytes it must touch.

    Attributes
    ----------
    name : str
        The step.
    median_ms, p95_ms : float
        Over the repeats after warm-up.
    bytes : int
        That must be read and written once, whatever the program.
    """

    name: str
    median_ms: float
    p95_ms: float
    bytes: int

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "name": self.name,
            "median_ms": self.median_ms,
            "p95_ms": self.p95_ms,
            "bytes": self.bytes,
        }


@dataclass(frozen=True, slots=True)
class BenchmarkResult:
    """Times of a whole frame, of its steps and of the alternatives, from one run.

    Attributes
    ----------
    total : Timing
        Picture to depth.
    steps : tuple of Timing
        Its parts.
    plain : Timing
        The same mathematics in plain NumPy and SciPy.
    copy_floor_ms : float
        Median time to copy as many bytes as the frame must read and write.
    threads : int
        Of the transforms.
    versions : dict
        Python, processor and libraries.
    plan : Plan
        Which steps the frame needed.
    """

    total: Timing
    steps: tuple[Timing, ...]
    plain: Timing
    copy_floor_ms: float
    threads: int
    versions: dict[str, str]
    plan: Plan


def benchmark_frame(
    reconstructor: Reconstructor, frame: NDArray[Any], *, repeats: int = 25, plain_repeats: int = 3
) -> BenchmarkResult:
    """Time one frame, its steps, the plain version and a copy of its bytes, taken in turn.

    Parameters
    ----------
    reconstructor : Reconstructor
        Ready for the frame's sensor.
    frame : (height, width, 3)
        Raw picture.
    repeats, plain_repeats : int, optional
        Counted runs after one warm-up.
    """
    calibration = reconstructor.calibration
    light = reconstructor.linearise(frame)
    steps: Steps = {}
    if reconstructor.model == "paper":
        steps = _paper_steps(reconstructor, light)
    elif reconstructor.effort == "best":
        steps = _full_steps(reconstructor, light)
    if calibration.response is not None and steps:
        undo = (lambda: reconstructor.linearise(frame), frame.nbytes + light.nbytes)
        steps = {"linear light": undo, **steps}
    table = calibration.table
    read = frame.nbytes + table.u_px.nbytes + table.v_px.nbytes + calibration.radiance.nbytes
    must = read + table.u_px.nbytes
    source, target = np.zeros(must // 2, np.uint8), np.empty(must // 2, np.uint8)
    plans: list[Plan] = []

    def whole() -> None:
        plan = reconstructor.depth(frame, normals=False).plan
        assert plan is not None
        plans.append(plan)

    fast: dict[str, Callable[[], object]] = {
        "picture to depth": whole,
        **{name: action for name, (action, _) in steps.items()},
        # Reading one half and writing the other touches as many bytes as the frame must.
        "copy of the bytes": lambda: np.copyto(target, source),
    }

    def plain() -> None:
        light = reconstructor.linearise(frame)
        plain_depth(*plain_slopes(light, calibration), table.grid.pitch_mm)

    times = _time_in_turn(fast, repeats)
    slow = _time_in_turn({"plain": plain}, plain_repeats)["plain"]
    return BenchmarkResult(
        _timing("picture to depth", times["picture to depth"], must),
        (
            *(_timing(name, times[name], size) for name, (_, size) in steps.items()),
            *_planned_steps(plans[-repeats:]),
        ),
        _timing("paper's model, plain NumPy and SciPy", slow, must),
        float(np.median(times["copy of the bytes"])),
        reconstructor.workers,
        {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in LIBRARIES},
        },
        plans[-1],
    )


Steps = dict[str, tuple[Callable[[], object], int]]


def _planned_steps(plans: list[Plan]) -> list[Timing]:
    """Return the times of the steps of a planned frame, as it noted them itself."""
    times: dict[str, list[float]] = {}
    sizes: dict[str, int] = {}
    for step in (step for plan in plans for step in plan.steps):
        if step.milliseconds is not None:
            times.setdefault(step.name, []).append(step.milliseconds)
            sizes[step.name] = step.bytes
    return [_timing(name, taken, sizes[name]) for name, taken in times.items()]


def _paper_steps(reconstructor: Reconstructor, frame: NDArray[Any]) -> Steps:
    """Return the paper's model step by step, each with the bytes that it touches."""
    maps, solver = reconstructor.maps, reconstructor.solver
    slopes = reconstructor.slope_solver
    divergence, field = slopes.divergence(frame, solver)
    read = frame.nbytes + maps.u_px.nbytes + maps.v_px.nbytes + maps.gain.nbytes
    return {
        "resampling, normals and their divergence": (
            lambda: slopes.divergence(frame, solver),
            read + divergence.nbytes + field.flags.nbytes,
        ),
        # Of a copy, because it is written over.
        "integration": (lambda: solver.depth_of(divergence.copy()), 2 * divergence.nbytes),
    }


def _full_steps(reconstructor: Reconstructor, frame: NDArray[Any]) -> Steps:
    """Return the full model step by step, each with the bytes that it touches."""
    calibration, full = reconstructor.calibration, reconstructor.calibration.full
    if full is None:
        return {}
    workers, pitch_mm = reconstructor.workers, calibration.table.grid.pitch_mm
    rgb = as_linear(frame)
    field = shaded_field(rgb, calibration, full)
    depth, _ = coarse_depth(field, full, pitch_mm, workers)
    leds, membrane = full.led_positions_mm, full.membrane
    slopes = solve_near_light(field, depth, leds, membrane, workers=workers)
    shaded = field.ratio.nbytes + field.sigma.nbytes + field.around.nbytes
    return {
        "resampling and comparing": (
            lambda: shaded_field(rgb, calibration, full),
            rgb.nbytes + shaded,
        ),
        "near light, quarter scale": (
            lambda: coarse_depth(field, full, pitch_mm, workers),
            shaded + depth.nbytes,
        ),
        "near light, full scale": (
            lambda: solve_near_light(field, depth, leds, membrane, workers=workers),
            shaded + 7 * depth.nbytes,
        ),
        "integration": (
            lambda: integrate_weighted(
                slopes.slope_x,
                slopes.slope_y,
                slopes.weight,
                pitch_mm=pitch_mm,
                start_mm=depth,
                workers=workers,
            ),
            4 * depth.nbytes,
        ),
        "true positions": (
            lambda: place_on_grid(depth, field.drift, field.x_mm, field.y_mm),
            4 * depth.nbytes,
        ),
    }


def _time_in_turn(actions: dict[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Time actions one after the other, round by round, so that a slow spell meets all alike."""
    for action in actions.values():
        action()
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats):
        for name, action in actions.items():
            begin = time.perf_counter()
            action()
            times[name].append(1e3 * (time.perf_counter() - begin))
    return times


def _timing(name: str, times_ms: list[float], size: int) -> Timing:
    return Timing(name, float(np.median(times_ms)), float(np.percentile(times_ms, 95)), int(size))
