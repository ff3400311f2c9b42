"""Slopes of known surfaces, and their integral by the program and by two transforms."""

import numpy as np
import scipy.fft

from gelpolight_core.reconstruction.integration.poisson import EdgeWeights, PoissonSolver


def smooth_bump(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return a smooth bump that is 0 at the border, its slopes (at most 1), and the pitch in mm.

    A product of squared sines over 20 mm.
    """
    pitch_mm = 20.0 / max(rows, columns)

    def axis(count: int) -> tuple[np.ndarray, np.ndarray, float]:
        phase, steepest = np.pi * (np.arange(count) + 0.5) / count, np.pi / (count * pitch_mm)
        return np.sin(phase) ** 2, np.sin(2.0 * phase) * steepest, steepest

    (down, down_slope, a), (across, across_slope, b) = axis(rows), axis(columns)
    height_mm = 1.0 / max(a, b, 1.0)
    depth, slope_x, slope_y = (
        (height_mm * np.outer(first, second)).astype(np.float32)
        for first, second in ((down, across), (down, across_slope), (down_slope, across))
    )
    return depth, slope_x, slope_y, pitch_mm


def divergence(slope_x: np.ndarray, slope_y: np.ndarray, edges: EdgeWeights) -> np.ndarray:
    """Return the divergence (rows, columns), in double precision."""
    (rows, columns), field = slope_x.shape, np.zeros(slope_x.shape)
    for tap in range(edges.weight_x.shape[1]):
        # A short line has fewer than five nodes; the weights of the others are 0.
        row = np.minimum(edges.start_y + tap, rows - 1)
        column = np.minimum(edges.start_x + tap, columns - 1)
        field += edges.weight_y[:, tap, None] * slope_y[row].astype(np.float64)
        field += edges.weight_x[:, tap] * slope_x[:, column].astype(np.float64)
    return field


def integrate_slopes(slope_x: np.ndarray, slope_y: np.ndarray, *, pitch_mm: float) -> np.ndarray:
    """Return the depth, mm, by the program's solver."""
    solver = PoissonSolver(*slope_x.shape, pitch_mm=pitch_mm)
    return solver.depth_of(divergence(slope_x, slope_y, solver.edges).astype(np.float32))


def exact_depth(slope_x: np.ndarray, slope_y: np.ndarray, pitch_mm: float) -> np.ndarray:
    """Return the depth, mm, by sine transforms along both axes in double precision."""
    edges = PoissonSolver(*slope_x.shape, pitch_mm=pitch_mm).edges
    return exact_solution(divergence(slope_x, slope_y, edges), pitch_mm)


def exact_solution(divergence: np.ndarray, pitch_mm: float) -> np.ndarray:
    """Solve the five-point Poisson equation with depth 0 half a node outside the grid."""
    waves = [4.0 * np.sin(0.5 * np.pi * (np.arange(n) + 1) / n) ** 2 for n in divergence.shape]
    spectrum = scipy.fft.dstn(-pitch_mm * divergence, type=2) / (waves[0][:, None] + waves[1])
    return scipy.fft.idstn(spectrum, type=2)
