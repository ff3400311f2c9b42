"""Extreme grids: integration on all sizes, with bad slopes, and at the solver's limits."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.stability import Case, Seen
from gelpolight_core.experiments.stability_trial import rms_um
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver, integrate_slopes
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
SUBJECT = "grids"
LEAST_NODES = 20
RIGHT_SHARE = 0.1
FINE_SHARE = 1e-4
SIZES = (
    (1, 1),
    (1, 2),
    (1, 20_000),
    (20_000, 1),
    (2, 2),
    (3, 5),
    (127, 131),
    (1279, 957),
    (16, 8192),
    (8192, 16),
    (4, 65_536),
)
LARGE = (4904, 6544)
"""32 megapixels with lengths for which the transform is slow: prime factors 613 and 409."""
TOLERANCES = (1e-2, 1e-3, 3e-4, 1e-6)


def grid_cases() -> tuple[Case, ...]:
    """Return the cases on grids of nodes."""
    right = tr("the bump from which the slopes were computed, or refused")
    sizes = [
        Case(
            f"grid_{rows}x{columns}",
            SUBJECT,
            tr("integration of {r} x {c} nodes").format(r=rows, c=columns),
            right,
            partial(_bump, rows, columns),
        )
        for rows, columns in SIZES
    ]
    large = Case(
        "grid_32_megapixels",
        SUBJECT,
        tr("integration of 32 million nodes in single precision"),
        right,
        partial(_bump, *LARGE),
        quick=False,
        memory=True,
    )
    bad = [
        Case(f"slopes_{name}", SUBJECT, label, required, run)
        for name, label, required, run in (
            (
                "nan",
                tr("one slope in a thousand not a number"),
                tr("finite; counted; the rest nearly unchanged"),
                partial(_spoilt, np.nan),
            ),
            (
                "infinite",
                tr("one slope in a thousand infinite"),
                tr("finite; counted; the rest nearly unchanged"),
                partial(_spoilt, np.inf),
            ),
            (
                "1e4",
                tr("one slope of 10000"),
                tr("clipped and counted; no peak beyond a few pixels"),
                _one_steep,
            ),
            (
                "denormal",
                tr("slopes of 1e-42"),
                tr("a depth of zero"),
                partial(_tiny, 1e-42),
            ),
        )
    ]
    return (
        *sizes,
        large,
        *bad,
        Case(
            "solver_tolerance",
            SUBJECT,
            tr("the weighted integration at tolerances 0.01 to 0.000001"),
            tr("the result does not depend on it"),
            _tolerances,
        ),
        Case(
            "weights_of_nothing",
            SUBJECT,
            tr("the weighted integration with all weights 0"),
            tr("finite"),
            _no_weights,
        ),
    )


def bump(rows: int, columns: int) -> tuple[Map, Map, Map, float]:
    """Return a smooth bump that is 0 at the border, its slopes (at most 1), and the pitch in mm.

    A product of squared sines over 20 mm; a single row or column is constant across.
    """
    pitch = 20.0 / max(rows, columns)

    def axis(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
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


def _bump(rows: int, columns: int) -> Seen:
    depth, slope_x, slope_y, pitch = bump(rows, columns)
    found = PoissonSolver(rows, columns, pitch_mm=pitch).integrate(slope_x, slope_y).depth_mm
    finite = bool(np.isfinite(found).all())
    if max(rows, columns) < LEAST_NODES:
        return Seen(finite, tr("finite; too few nodes for a bump"), finite)
    error = rms_um(np.asarray(found - depth, np.float64).ravel())
    peak_um = 1e3 * float(depth.max())
    summary = tr("{e:.2g} um RMS on a bump of {h:.4g} um").format(e=error, h=peak_um)
    # With so few nodes, a bump is not smooth.
    share = RIGHT_SHARE if min(rows, columns) in range(2, LEAST_NODES) else FINE_SHARE
    return Seen(True, summary, finite, error, share * peak_um)


def _spoilt(value: float) -> Seen:
    depth, slope_x, slope_y, pitch = bump(240, 320)
    rng = np.random.default_rng(0)
    bad = rng.random(depth.shape) < 1e-3
    slope_x[bad] = value
    result = integrate_slopes(slope_x, slope_y, pitch_mm=pitch)
    error = rms_um(np.asarray(result.depth_mm - depth, np.float64).ravel())
    counted = result.sanitised_count == np.count_nonzero(bad)
    summary = tr("{e:.2f} um RMS; {n} values counted").format(e=error, n=result.sanitised_count)
    return Seen(bool(counted), summary, bool(np.isfinite(result.depth_mm).all()), error, 3.0)


def _one_steep() -> Seen:
    _, slope_x, slope_y, pitch = bump(240, 320)
    slope_x[:], slope_y[:] = 0.0, 0.0
    slope_x[120, 160] = 1e4
    result = integrate_slopes(slope_x, slope_y, pitch_mm=pitch)
    peak_px = float(np.abs(result.depth_mm).max()) / pitch
    summary = tr("a peak of {p:.1f} pixels; {n} value clipped").format(
        p=peak_px, n=result.clipped_count
    )
    return Seen(peak_px < 5.0 and result.clipped_count == 1, summary)


def _tiny(value: float) -> Seen:
    slope = np.full((64, 64), value, np.float32)
    depth = integrate_slopes(slope, slope, pitch_mm=0.1).depth_mm
    deepest = float(np.abs(depth).max())
    summary = tr("at most {d:.1g} mm").format(d=deepest)
    return Seen(deepest < 1e-30, summary, bool(np.isfinite(depth).all()))


def _walled() -> tuple[Map, Map, Map, Map, float]:
    """Return a bump whose slopes are wrong along a ring, with low weights there."""
    depth, slope_x, slope_y, pitch = bump(240, 320)
    y, x = np.mgrid[:240, :320]
    ring = np.abs(np.hypot(x - 160, y - 120) - 60.0) < 2.0
    slope_x[ring], slope_y[ring] = 0.0, 0.0
    weight = np.where(ring, 0.01, 1.0).astype(np.float32)
    return depth, slope_x, slope_y, weight, pitch


def _tolerances() -> Seen:
    _, slope_x, slope_y, weight, pitch = _walled()
    found = [
        integrate_weighted(slope_x, slope_y, weight, pitch_mm=pitch, tolerance=t)
        for t in TOLERANCES
    ]
    best = found[-1].depth_mm
    away = [1e3 * float(np.abs(f.depth_mm - best).max()) for f in found[:-1]]
    used = TOLERANCES.index(3e-4)
    summary = tr("at most {a} um from the strictest, {r} rounds").format(
        a=" / ".join(f"{x:.2f}" for x in away), r=" / ".join(str(f.rounds) for f in found)
    )
    return Seen(away[used] < 2.0, summary, rounds=found[used].rounds)


def _no_weights() -> Seen:
    _, slope_x, slope_y, weight, pitch = _walled()
    found = integrate_weighted(slope_x, slope_y, np.zeros_like(weight), pitch_mm=pitch)
    summary = tr("at most {d:.2g} mm").format(d=float(np.abs(found.depth_mm).max()))
    return Seen(True, summary, bool(np.isfinite(found.depth_mm).all()), rounds=found.rounds)
