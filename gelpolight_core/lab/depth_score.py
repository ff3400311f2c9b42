"""Errors of a depth map against the true one: plateau height, size at half height, depth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.npy import read_arrays
from gelpolight_core.base.safe_reading import missing_file
from gelpolight_core.session.session import SensorData

KEYS = ("depth_mm", "x0_mm", "y0_mm", "pitch_mm")
EDGE_MM = 1.0
"""Width of the edge of the working circle in which no depth is compared."""


@dataclass(frozen=True, slots=True)
class TrueDepth:
    """The true depth of a press on a metric grid in the sensor frame.

    Attributes
    ----------
    depth_mm : (rows, columns) float64
        Indentation.
    x_mm, y_mm : (columns,), (rows,) float64
        Nodes.
    """

    depth_mm: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DepthScore:
    """Signed errors of one depth map against the true one.

    Attributes
    ----------
    height_percent : float
        Median over the true plateau (above 98 % of the nominal height), compared with the true
        median.
    size_percent : float
        Root of the area above half the nominal height, compared with the true one.
    rms_um : float
        Root mean square of the difference of the depths.
    """

    height_percent: float
    size_percent: float
    rms_um: float


def score_depth(
    depth_mm: NDArray[np.float32],
    x_mm: NDArray[np.floating],
    y_mm: NDArray[np.floating],
    truth: TrueDepth,
    *,
    height_mm: float,
    radius_mm: float,
) -> DepthScore:
    """Compare a depth map with the truth at the truth's nodes.

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth on a regular grid; what is not finite counts as 0.
    x_mm, y_mm : (columns,), (rows,)
        Its nodes, sensor frame.
    truth : TrueDepth
        What was pressed.
    height_mm : float
        Nominal height of the object.
    radius_mm : float
        Only nodes within it of the sensor frame's origin count.

    Raises
    ------
    ValueError
        If no node of the true plateau lies within the radius and the depth map.
    """
    x, y = np.meshgrid(truth.x_mm, truth.y_mm)
    column = (x - x_mm[0]) / (x_mm[1] - x_mm[0])
    row = (y - y_mm[0]) / (y_mm[1] - y_mm[0])
    rows, columns = depth_mm.shape
    counts = (column >= 0) & (row >= 0) & (column <= columns - 1) & (row <= rows - 1)
    counts &= np.hypot(x, y) < radius_mm
    finite_mm = np.nan_to_num(depth_mm, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
    measured_mm = cv2.remap(
        finite_mm, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR
    ).astype(np.float64)
    true = truth.depth_mm
    top = counts & (true > 0.98 * height_mm)
    if not top.any():
        raise ValueError(f"no plateau of {height_mm} mm within {radius_mm} mm of the centre")
    area = [np.count_nonzero(counts & (depth > 0.5 * height_mm)) for depth in (measured_mm, true)]
    return DepthScore(
        float(100.0 * (np.median(measured_mm[top]) / np.median(true[top]) - 1.0)),
        float(100.0 * (np.sqrt(area[0] / area[1]) - 1.0)),
        float(1e3 * np.sqrt(np.mean((measured_mm - true)[counts] ** 2))),
    )


def scored_radius_mm(sensor: SensorData) -> float:
    """Return the radius in which a depth is compared with its truth, which has no edge."""
    return 0.5 * sensor.working_diameter_mm - EDGE_MM


def read_true_depth(path: Path) -> TrueDepth:
    """Read the truth of a press (npz: depth_mm, x0_mm, y0_mm, pitch_mm).

    Raises
    ------
    InputError
        If the file is missing, is not such a file, or lacks one of these.
    """
    try:
        arrays = read_arrays(path, KEYS)
        depth, x0, y0, pitch = (arrays[key].astype(np.float64) for key in KEYS)
    except FileNotFoundError as error:
        raise missing_file(path) from error
    except (ValueError, KeyError) as error:
        raise _not_a_truth(path) from error
    if not x0.size == y0.size == pitch.size == 1:
        raise _not_a_truth(path)
    finite = all(np.isfinite(values).all() for values in (depth, x0, y0, pitch))
    if depth.ndim != 2 or not finite or not pitch > 0.0:
        raise _not_a_truth(path)
    if np.abs(depth).max(initial=0.0) > pitch * max(depth.shape):  # of another unit
        raise _not_a_truth(path)
    rows, columns = depth.shape
    return TrueDepth(depth, x0 + pitch * np.arange(columns), y0 + pitch * np.arange(rows))


def _not_a_truth(path: Path) -> InputError:
    return InputError(
        "the file does not contain the true depth of a press", path, Remedy.CHOOSE_SESSION
    )
