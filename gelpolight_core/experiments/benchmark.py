"""Time of each step of a frame, compared with the plain version and with a memory copy."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.plain_paper import plain_depth, plain_slopes
from gelpolight_core.reconstruction.in_place.calibration import InPlaceCalibration
from gelpolight_core.reconstruction.in_place.terms import design_rows, position_axes
from gelpolight_core.reconstruction.linear import as_linear
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import Trace

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
        Bytes that any program must read and write once.
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
        Image to depth.
    steps : tuple of Timing
        Its parts.
    plain : Timing
        The same mathematics in plain NumPy and SciPy.
    copy_floor_ms : float
        Median time to copy the number of bytes that the frame must read and write.
    threads : int
        Of the transforms.
    versions : dict
        Python, processor and libraries.
    trace : Trace
        Which steps the frame needed.
    """

    total: Timing
    steps: tuple[Timing, ...]
    plain: Timing
    copy_floor_ms: float
    threads: int
    versions: dict[str, str]
    trace: Trace


def benchmark_frame(
    reconstructor: Reconstructor, frame: NDArray[Any], *, repeats: int = 25, plain_repeats: int = 3
) -> BenchmarkResult:
    """Time one frame, its steps, the plain version and a copy of its bytes, taken in turn.

    Parameters
    ----------
    reconstructor : Reconstructor
        Ready for the frame's sensor.
    frame : (height, width, 3)
        Raw image.
    repeats, plain_repeats : int, optional
        Counted runs after one warm-up.
    """
    calibration = reconstructor.calibration
    table = calibration.table
    closed = isinstance(calibration, InPlaceCalibration)
    maps = table.u_px.nbytes + table.v_px.nbytes
    known = (
        calibration.in_place.background.nbytes
        if isinstance(calibration, InPlaceCalibration)
        else maps + calibration.radiance.nbytes
    )
    must = frame.nbytes + known + table.u_px.nbytes
    # Memory pages that were never written to are all the same page, which is in the cache.
    source, target = np.ones(must // 2, np.uint8), np.ones(must // 2, np.uint8)
    traces: list[Trace] = []

    def whole() -> None:
        trace = reconstructor.depth(frame, normals=False).trace
        assert trace is not None
        traces.append(trace)

    fast: dict[str, Callable[[], object]] = {
        "image to depth": whole,
        # Reading one half and writing the other touches as many bytes as the frame must.
        "copy of the bytes": lambda: np.copyto(target, source),
    }

    def plain() -> None:
        if isinstance(calibration, InPlaceCalibration):
            _plain_in_place(reconstructor.linearise(frame), calibration)
            return
        light = reconstructor.linearise(frame)
        plain_depth(*plain_slopes(light, calibration), table.grid.pitch_mm)

    times = _time_in_turn(fast, repeats)
    slow = _time_in_turn({"plain": plain}, plain_repeats)["plain"]
    return BenchmarkResult(
        _timing("image to depth", times["image to depth"], must),
        _traced_steps(traces[-repeats:]),
        _timing(
            "in-place, plain NumPy and SciPy" if closed else "paper's model, plain NumPy and SciPy",
            slow,
            must,
        ),
        float(np.median(times["copy of the bytes"])),
        reconstructor.workers,
        {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in LIBRARIES},
        },
        traces[-1],
    )


def _plain_in_place(light: NDArray[Any], calibration: InPlaceCalibration) -> None:
    """Reconstruct a closed sensor's frame with NumPy and SciPy alone."""
    model = calibration.in_place
    change = model.change(as_linear(light)).change
    rows, columns = change.shape[:2]
    x, y = np.meshgrid(*position_axes(rows, columns))
    terms = design_rows(change.reshape(-1, 3), x.ravel(), y.ravel())
    slopes = (terms @ model.coefficients).reshape(rows, columns, 2)
    plain_depth(slopes[..., 0], slopes[..., 1], model.grid.pitch_mm)


def _traced_steps(traces: list[Trace]) -> tuple[Timing, ...]:
    """Return the times of a frame's steps from its trace."""
    times: dict[str, list[float]] = {}
    sizes: dict[str, int] = {}
    for step in (step for trace in traces for step in trace.steps):
        if step.milliseconds is not None:
            times.setdefault(step.name, []).append(step.milliseconds)
            sizes[step.name] = step.bytes
    return tuple(_timing(name, seconds, sizes[name]) for name, seconds in times.items())


def _time_in_turn(actions: dict[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Time actions in turn, round by round, so that a slow phase of the machine affects all."""
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
