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

from gelpolight_core.reconstruction.plain import plain_depth, plain_slopes
from gelpolight_core.reconstruction.reconstructor import Reconstructor

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
    """

    total: Timing
    steps: tuple[Timing, ...]
    plain: Timing
    copy_floor_ms: float
    threads: int
    versions: dict[str, str]


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
    maps, solver, calibration = (
        reconstructor.maps,
        reconstructor.solver,
        reconstructor.calibration,
    )
    field = reconstructor.slopes(frame)
    read = frame.nbytes + maps.u_px.nbytes + maps.v_px.nbytes + maps.gain.nbytes
    slope_bytes = field.slope_x.nbytes + field.slope_y.nbytes
    written = slope_bytes + field.flags.nbytes + field.length_error.nbytes
    depth_bytes = field.slope_x.nbytes
    source = np.zeros(read + slope_bytes, np.uint8)
    target = np.zeros_like(source)
    pitch_mm = calibration.table.grid.pitch_mm

    def plain() -> None:
        plain_depth(*plain_slopes(frame, calibration), pitch_mm)

    fast: dict[str, Callable[[], object]] = {
        "picture to depth": lambda: reconstructor.depth(frame, normals=False),
        "resampling and normals": lambda: reconstructor.slopes(frame),
        "integration": lambda: solver.integrate(field.slope_x, field.slope_y),
        "copy of the bytes": lambda: np.copyto(target, source),
    }
    times = _time_in_turn(fast, repeats)
    slow = _time_in_turn({"plain": plain}, plain_repeats)["plain"]
    sizes = {
        "picture to depth": read + depth_bytes,
        "resampling and normals": read + written,
        "integration": slope_bytes + depth_bytes,
    }
    timings = {name: _timing(name, times[name], size) for name, size in sizes.items()}
    return BenchmarkResult(
        timings["picture to depth"],
        (timings["resampling and normals"], timings["integration"]),
        _timing("plain NumPy and SciPy", slow, read + depth_bytes),
        float(np.median(times["copy of the bytes"])),
        solver.workers,
        {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in LIBRARIES},
        },
    )


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
