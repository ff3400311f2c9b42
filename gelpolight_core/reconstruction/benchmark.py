"""Time of each step of a frame, compared with a memory copy."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .reconstructor import Reconstructor
from .trace import Trace

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


@dataclass(frozen=True, slots=True)
class BenchmarkResult:
    """Times of a whole frame and of its steps, from one run.

    Attributes
    ----------
    total : Timing
        Image to depth.
    steps : tuple of Timing
        Its parts.
    copy_floor_ms : float
        Median time to copy the number of bytes that the frame must read and write.
    threads : int
        Number of threads.
    versions : dict
        Python, processor and libraries.
    trace : Trace
        Which steps the frame needed.
    """

    total: Timing
    steps: tuple[Timing, ...]
    copy_floor_ms: float
    threads: int
    versions: dict[str, str]
    trace: Trace


def benchmark_frame(
    reconstructor: Reconstructor, frame: NDArray[Any], *, repeats: int = 25
) -> BenchmarkResult:
    """Time one frame with its steps, and a copy of its bytes, in turn.

    Parameters
    ----------
    reconstructor : Reconstructor
        Ready for the frame's sensor.
    frame : (height, width, 3)
        Raw image.
    repeats : int, optional
        Counted runs after one warm-up.
    """
    size = _bytes_of(reconstructor, frame)
    # Memory pages that were never written to are all the same page, which is in the cache.
    source, target = np.ones(size // 2, np.uint8), np.ones(size // 2, np.uint8)
    traces: list[Trace] = []

    def whole() -> None:
        trace = reconstructor.depth(frame, normals=False).trace
        assert trace is not None
        traces.append(trace)

    # In turn, so that a slow phase of the machine affects both.
    frame_ms, copy_ms = [], []
    for _ in range(1 + repeats):
        frame_ms.append(_milliseconds(whole))
        # Reading one half and writing the other touches as many bytes as the frame must.
        copy_ms.append(_milliseconds(lambda: np.copyto(target, source)))
    return BenchmarkResult(
        _timing("image to depth", frame_ms[1:], size),
        _traced_steps(traces[1:]),
        float(np.median(copy_ms[1:])),
        reconstructor.workers,
        {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in LIBRARIES},
        },
        traces[-1],
    )


def _bytes_of(reconstructor: Reconstructor, frame: NDArray[Any]) -> int:
    """Return the bytes of a frame, of the maps that it needs, and of its depth."""
    data = reconstructor.calibration.data
    table = data.table
    map_bytes = table.u_px.nbytes + table.v_px.nbytes + data.background.nbytes
    return frame.nbytes + map_bytes + table.u_px.nbytes


def _milliseconds(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - begin)


def _traced_steps(traces: list[Trace]) -> tuple[Timing, ...]:
    """Return the times of a frame's steps from its traces; a step can have several rounds."""
    times: dict[str, list[float]] = {}
    sizes: dict[str, int] = {}
    for trace in traces:
        done = [step for step in trace.steps if step.milliseconds is not None]
        for name in dict.fromkeys(step.name for step in done):
            rounds = [step for step in done if step.name == name]
            times.setdefault(name, []).append(sum(step.milliseconds or 0.0 for step in rounds))
            sizes[name] = sum(step.bytes for step in rounds)
    return tuple(_timing(name, times_ms, sizes[name]) for name, times_ms in times.items())


def _timing(name: str, times_ms: list[float], size: int) -> Timing:
    return Timing(name, float(np.median(times_ms)), float(np.percentile(times_ms, 95)), int(size))
