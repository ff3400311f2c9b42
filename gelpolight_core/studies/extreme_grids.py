"""Extreme grids: integration on all sizes, with bad slopes, and results that must repeat."""

from __future__ import annotations

import math

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.integration.weighted import TOLERANCE, integrate_weighted
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .image_case_helpers import rms_um, standard_press, standard_sensor
from .stability import CaseMeasurement, single_measurement

LEAST_NODES = 20
RIGHT_SHARE, FINE_SHARE = 0.1, 1e-4
"""Accepted error, as a share of the bump's height: on a few nodes it is not smooth."""
LARGE = (4904, 6544)
"""32 megapixels with lengths for which the transform is slow: prime factors 613 and 409."""
TINY = ((1, 1), (1, 2), (2, 2), (3, 5))
LINES = ((1, 20_000), (20_000, 1), (16, 8192), (8192, 16), (4, 65_536))
PRIME = ((127, 131), (1279, 957), LARGE)
TOLERANCES = (1e-2, 1e-3, TOLERANCE, 1e-6)


def bump(rows: int, columns: int) -> tuple[Float32Array, Float32Array, Float32Array, float]:
    """Return a smooth bump that is 0 at the border, its slopes (at most 1), and the pitch in mm.

    A product of squared sines over 20 mm; a single row or column is constant across.
    """
    pitch = 20.0 / max(rows, columns)

    def axis(count: int) -> tuple[Float64Array, Float64Array, float]:
        if count == 1:
            return np.ones(1), np.zeros(1), 0.0
        phase, steepest = np.pi * (np.arange(count) + 0.5) / count, np.pi / (count * pitch)
        return np.sin(phase) ** 2, np.sin(2.0 * phase) * steepest, steepest

    (down, down_slope, a), (across, across_slope, b) = axis(rows), axis(columns)
    height_mm = 1.0 / max(a, b, 1.0)
    depth, slope_x, slope_y = (
        (height_mm * np.outer(first, second)).astype(np.float32)
        for first, second in ((down, across), (down, across_slope), (down_slope, across))
    )
    return depth, slope_x, slope_y, pitch


def integrated(rows: int, columns: int) -> CaseMeasurement:
    """Integrate the slopes of a bump."""
    depth, slope_x, slope_y, pitch = bump(rows, columns)
    depth_map = PoissonSolver(rows, columns, pitch_mm=pitch).integrate(slope_x, slope_y).depth_mm
    error, peak_um = rms_um((depth_map - depth).astype(np.float64)), 1e3 * float(depth.max())
    summary = f"{error:.2g} um RMS on a bump of {peak_um:.4g} um"
    if max(rows, columns) < LEAST_NODES:  # too few for a bump
        return single_measurement(math.isfinite(error), summary)
    share = RIGHT_SHARE if min(rows, columns) in range(2, LEAST_NODES) else FINE_SHARE
    return single_measurement(True, summary, error_um=error, bound_um=share * peak_um)


def spoilt(value: float) -> CaseMeasurement:
    """Integrate with one slope in a thousand replaced."""
    depth, slope_x, slope_y, pitch = bump(240, 320)
    bad_mask = np.random.default_rng(0).random(depth.shape) < 1e-3
    slope_x[bad_mask] = value
    result = PoissonSolver(*depth.shape, pitch_mm=pitch).integrate(slope_x, slope_y)
    error = rms_um((result.depth_mm - depth).astype(np.float64))
    counted = result.sanitised_count == np.count_nonzero(bad_mask)
    summary = f"{error:.2f} um RMS; {result.sanitised_count} values counted"
    # Accepted error with one slope in a thousand missing, on a bump of some millimetres.
    return single_measurement(counted, summary, error_um=error, bound_um=3.0)


def one_steep() -> CaseMeasurement:
    """Integrate a single slope that is too steep."""
    depth, _, _, pitch = bump(240, 320)
    slope_x = np.zeros_like(depth)
    slope_x[120, 160] = 1e4
    result = PoissonSolver(*depth.shape, pitch_mm=pitch).integrate(slope_x, 0.0 * slope_x)
    peak_px = float(np.abs(result.depth_mm).max()) / pitch
    summary = f"a peak of {peak_px:.1f} pixels; {result.clipped_count} value clipped"
    return single_measurement(peak_px < 5.0 and result.clipped_count == 1, summary)


def denormal() -> CaseMeasurement:
    """Integrate slopes that are hardly numbers."""
    slope = np.full((64, 64), 1e-42, np.float32)
    deepest = np.abs(PoissonSolver(64, 64, pitch_mm=0.1).integrate(slope, slope).depth_mm).max()
    return single_measurement(bool(deepest < 1e-30), f"at most {deepest:.1g} mm")


def _walled() -> tuple[Float32Array, Float32Array, Float32Array, float]:
    """Return a bump's slopes, wrong along a ring, with low weights there, and the pitch."""
    _, slope_x, slope_y, pitch = bump(240, 320)
    y, x = np.mgrid[:240, :320]
    ring = np.abs(np.hypot(x - 160, y - 120) - 60.0) < 2.0
    slope_x[ring], slope_y[ring] = 0.0, 0.0
    return slope_x, slope_y, np.where(ring, 0.01, 1.0).astype(np.float32), pitch


def tolerances() -> CaseMeasurement:
    """Compare results of the weighted solver at several tolerances."""
    *maps, pitch = _walled()
    results = [integrate_weighted(*maps, pitch_mm=pitch, tolerance=t) for t in TOLERANCES]
    strictest_mm = results[-1].depth_mm
    errors_um = [1e3 * float(np.abs(f.depth_mm - strictest_mm).max()) for f in results[:-1]]
    texts = " / ".join(f"{um:.2f}" for um in errors_um), " / ".join(str(f.rounds) for f in results)
    summary = f"at most {texts[0]} um from the strictest, {texts[1]} rounds"
    return single_measurement(errors_um[TOLERANCES.index(TOLERANCE)] < 2.0, summary)


def no_weights() -> CaseMeasurement:
    """Integrate slopes of which none counts."""
    slope_x, slope_y, weight, pitch = _walled()
    depth = integrate_weighted(slope_x, slope_y, np.zeros_like(weight), pitch_mm=pitch).depth_mm
    return single_measurement(
        bool(np.isfinite(depth).all()), f"at most {np.abs(depth).max():.2g} mm"
    )


def repeated(model: str, threads: tuple[int, ...]) -> CaseMeasurement:
    """Reconstruct repeatedly, by numbers of threads."""
    calibration, frame = standard_sensor().calibration, standard_press().frame
    first, *maps = (
        Reconstructor(calibration, model=model, workers=n).depth(frame) for n in threads
    )
    same = all(np.array_equal(first.flags, other.flags) for other in maps)
    difference_mm = max(float(np.abs(other.depth_mm - first.depth_mm).max()) for other in maps)
    return single_measurement(
        same and difference_mm == 0.0, f"up to {1e3 * difference_mm:.2g} um apart"
    )


def precision(rows: int, columns: int) -> CaseMeasurement:
    """Compare single with double precision."""
    _, slope_x, slope_y, pitch = bump(rows, columns)
    single, double = (
        PoissonSolver(rows, columns, pitch_mm=pitch, dtype=kind).integrate(slope_x, slope_y)
        for kind in (np.float32, np.float64)
    )
    difference_um = 1e3 * float(np.abs(single.depth_mm - double.depth_mm).max())
    summary = f"at most {difference_um:.2g} um of 1 mm apart"
    return single_measurement(True, summary, error_um=difference_um, bound_um=0.05)
