"""The one resampling table: raw pixel for every node of a regular grid on the membrane.

Lens distortion, refraction, tilt and metric scale are all held by this table, so that a frame is
interpolated once. An inverse table leaves no holes and merges no pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from gelpolight_core.errors import InputError
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.refraction import LayerStack, camera_to_membrane, membrane_to_camera
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
FLOAT32_MAX_PIXELS = 32_766
GRID_PER_PICTURE = 8.0
# Just before a lens model turns back, a hundredth of a pixel moves a ray by degrees.
BEFORE_FOLD = 0.9
# Less than this holds no indentation with undeformed membrane about it.
LEAST_NODES = 32


@dataclass(frozen=True, slots=True)
class MembraneGrid:
    """A regular grid on the undeformed top surface, sensor frame.

    Attributes
    ----------
    x_mm, y_mm : (columns,), (rows,)
        Node coordinates, increasing.
    pitch_mm : float
        Distance between neighbouring nodes.
    """

    x_mm: Array
    y_mm: Array
    pitch_mm: float

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.y_mm.size, self.x_mm.size

    def points_mm(self) -> Array:
        """(rows, columns, 2) node positions (x, y)."""
        return np.stack(np.meshgrid(self.x_mm, self.y_mm), axis=-1)

    def to_index(self, points_mm: Array) -> Array:
        """Return fractional (column, row) of positions (..., 2) in mm."""
        origin = np.array([self.x_mm[0], self.y_mm[0]])
        return np.asarray((np.asarray(points_mm) - origin) / self.pitch_mm)


@dataclass(frozen=True, slots=True)
class ResamplingTable:
    """Where in the raw picture each membrane node is seen.

    Attributes
    ----------
    grid : MembraneGrid
        The nodes.
    u_px, v_px : (rows, columns) float32
        Raw pixel coordinates; -1 where a node is not seen.
    valid : (rows, columns) bool
        Seen by the camera and inside the working circle.
    drift : (rows, columns, 2) float32
        Sideways move (x, y) of the seen surface point per mm of depth.
    """

    grid: MembraneGrid
    u_px: NDArray[np.float32]
    v_px: NDArray[np.float32]
    valid: NDArray[np.bool_]
    drift: NDArray[np.float32]

    def apply(self, rgb: NDArray[np.float32]) -> NDArray[np.float32]:
        """Resample a raw picture (height, width[, 3]) onto the grid, bilinear; 0 outside."""
        return np.asarray(
            cv2.remap(rgb, self.u_px, self.v_px, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT),
            dtype=np.float32,
        )


def build_resampling_table(
    camera: Camera,
    plane: TopPlane,
    stack: LayerStack,
    *,
    working_diameter_mm: float,
    pitch_mm: float | None = None,
) -> ResamplingTable:
    """Build the table for the part of the working circle that the camera sees.

    Parameters
    ----------
    camera, plane, stack
        Optics.
    working_diameter_mm : float
        Diameter of the working circle about the sensor frame's origin.
    pitch_mm : float, optional
        Node distance; by default one raw pixel's footprint at the origin.

    Raises
    ------
    InputError
        If the camera sees nothing of the working circle, or the picture is too large.
    """
    if max(camera.width, camera.height) > FLOAT32_MAX_PIXELS:
        raise InputError(
            tr("the picture is {w} x {h} pixels").format(w=camera.width, h=camera.height),
            where=tr("camera"),
            advice=tr("Use pictures of at most {n} pixels a side").format(n=FLOAT32_MAX_PIXELS),
        )
    grid = visible_grid(camera, plane, stack, diameter_mm=working_diameter_mm, pitch_mm=pitch_mm)
    points = grid.points_mm()
    directions = membrane_to_camera(points, plane, stack)
    pixels = camera.project(directions)
    steepest = BEFORE_FOLD * camera.fold
    inside = (
        (directions[..., 2] > 0.0)
        & (pixels >= 0.0).all(axis=-1)
        & (np.hypot(directions[..., 0], directions[..., 1]) < steepest * directions[..., 2])
        & (pixels[..., 0] <= camera.width - 1)
        & (pixels[..., 1] <= camera.height - 1)
    )
    in_circle = np.hypot(points[..., 0], points[..., 1]) <= working_diameter_mm / 2
    _, drift = camera_to_membrane(directions, plane, stack)
    seen = np.where(inside[..., None], pixels, -1.0).astype(np.float32)
    return ResamplingTable(
        grid,
        np.ascontiguousarray(seen[..., 0]),
        np.ascontiguousarray(seen[..., 1]),
        inside & in_circle,
        drift.astype(np.float32),
    )


def paraxial_footprint_mm(camera: Camera, stack: LayerStack) -> float:
    """Return the size of one raw pixel on the membrane at the sensor frame's origin.

    Parameters
    ----------
    camera, stack
        Lens, and layers below the top surface.
    """
    apparent = sum(t / n for t, n in zip(stack.thicknesses_mm, stack.indices, strict=True))
    return apparent / max(camera.fx, camera.fy)


def visible_grid(
    camera: Camera,
    plane: TopPlane,
    stack: LayerStack,
    *,
    diameter_mm: float,
    pitch_mm: float | None = None,
) -> MembraneGrid:
    """Return the grid over the seen part of the working circle, in transform-friendly sizes.

    Parameters
    ----------
    camera, plane, stack, pitch_mm
        As in :func:`build_resampling_table`.
    diameter_mm : float
        Of the working circle.

    Raises
    ------
    InputError
        If the camera sees nothing of the working circle, or the grid would be too large.
    """
    if pitch_mm is None:
        pitch_mm = paraxial_footprint_mm(camera, stack)
    u = np.linspace(0.0, camera.width - 1, 65)
    v = np.linspace(0.0, camera.height - 1, 65)
    border = np.concatenate(
        [np.stack(np.broadcast_arrays(u, edge), -1) for edge in (0.0, camera.height - 1.0)]
        + [np.stack(np.broadcast_arrays(edge, v), -1) for edge in (0.0, camera.width - 1.0)]
    )
    seen, _ = camera_to_membrane(camera.directions(border), plane, stack)
    ahead = seen[np.isfinite(seen).all(axis=-1)]
    low = np.maximum(ahead.min(axis=0, initial=np.inf), -diameter_mm / 2)
    high = np.minimum(ahead.max(axis=0, initial=-np.inf), diameter_mm / 2)
    if not (high - low > 2 * pitch_mm).all():
        raise InputError(
            tr("the camera sees nothing of the working circle"),
            where="top_pose",
            advice=tr("Check the board's square size and the picture of the top surface"),
        )
    if not (high - low >= LEAST_NODES * pitch_mm).all():
        raise InputError(
            tr("the working circle's seen part is {x:.2f} x {y:.2f} mm, below {n} pixels").format(
                x=high[0] - low[0], y=high[1] - low[1], n=LEAST_NODES
            ),
            where=tr("what is stated of the sensor"),
            advice=tr("State the working diameter in mm, as the width of the membrane in use"),
        )
    nodes = float(np.prod((high - low) / pitch_mm + 2.0))
    if nodes > GRID_PER_PICTURE * camera.width * camera.height:
        raise InputError(
            tr("the membrane grid would have {n:.1e} nodes").format(n=nodes),
            where=tr("camera"),
            advice=tr("Check focal length and working diameter, or state a wider pitch"),
        )
    axes = []
    for start, stop in zip(low, high, strict=True):
        # In fours, so that a quarter-scale grid has whole nodes too.
        quarter = int(np.ceil(((stop - start) / pitch_mm + 1.0) / 4.0))
        count = 4 * next_fast_len(quarter, real=True)
        middle = (start + stop) / 2
        axes.append(middle + pitch_mm * (np.arange(count) - (count - 1) / 2))
    return MembraneGrid(axes[0], axes[1], float(pitch_mm))
