"""The one resampling table: raw pixel coordinates for every node of a regular membrane grid.

The table combines lens distortion, refraction, tilt and metric scale, so that a frame is
interpolated only once. An inverse table leaves no holes and merges no pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.fft import next_fast_len

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.parallel import in_parallel

from .camera import CameraModel
from .membrane_shape import FLAT, MembraneShape
from .refraction import LayerStack, camera_to_membrane, membrane_to_camera
from .sensor_frame import TopPlane

BLOCK_ROWS = 64
"""Rows of the table computed by one thread at a time: few enough to stay in the cache."""
FLOAT32_MAX_PIXELS = 32_766
GRID_PER_IMAGE = 8.0
# A smaller field cannot contain an indentation with undeformed membrane around it.
LEAST_NODES = 32


@dataclass(frozen=True, slots=True)
class MembraneGrid:
    """A regular grid of points (x, y) of the undeformed membrane, sensor frame.

    Attributes
    ----------
    x_mm, y_mm : (columns,), (rows,)
        Node coordinates, increasing.
    pitch_mm : float
        Distance between neighbouring nodes.
    """

    x_mm: Float64Array
    y_mm: Float64Array
    pitch_mm: float

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.y_mm.size, self.x_mm.size

    def points_mm(self) -> Float64Array:
        """(rows, columns, 2) node positions (x, y)."""
        return np.stack(np.meshgrid(self.x_mm, self.y_mm), axis=-1)

    def to_index(self, points_mm: Float64Array) -> Float64Array:
        """Return fractional (column, row) of positions (..., 2) in mm."""
        origin = np.array([self.x_mm[0], self.y_mm[0]])
        return np.asarray((np.asarray(points_mm) - origin) / self.pitch_mm)


@dataclass(frozen=True, slots=True)
class ResamplingTable:
    """Position in the raw image of each membrane node.

    Attributes
    ----------
    grid : MembraneGrid
        The nodes.
    u_px, v_px : (rows, columns) float32
        Raw pixel coordinates; -1 for nodes that are not visible.
    valid : (rows, columns) bool
        Visible to the camera and inside the working circle.
    ray_slope : (rows, columns, 2) float32
        Ray slope: lateral shift (x, y) of the visible surface point per mm of depth.
    surface : MembraneShape
        The undeformed membrane, on which the nodes lie.
    """

    grid: MembraneGrid
    u_px: Float32Array
    v_px: Float32Array
    valid: BoolArray
    ray_slope: Float32Array
    surface: MembraneShape = FLAT

    def apply(self, rgb: Float32Array) -> Float32Array:
        """Resample a raw image (height, width[, 3]) onto the grid, bilinear, 0 outside."""
        return np.asarray(
            cv2.remap(rgb, self.u_px, self.v_px, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT),
            dtype=np.float32,
        )


@lru_cache(maxsize=1)
def build_resampling_table(
    camera: CameraModel,
    plane: TopPlane,
    stack: LayerStack,
    *,
    working_diameter_mm: float,
    surface: MembraneShape = FLAT,
    pitch_mm: float | None = None,
) -> ResamplingTable:
    """Build the table for the part of the working circle that the camera sees.

    Parameters
    ----------
    camera, plane, stack
        Optics.
    working_diameter_mm : float
        Diameter of the working circle around the membrane's axis.
    surface : MembraneShape, optional
        The undeformed membrane.
    pitch_mm : float, optional
        Node spacing; by default the footprint of one raw pixel at the origin.

    Raises
    ------
    InputError
        If the camera sees nothing of the working circle, or the image is too large.
    """
    width, height = camera.width, camera.height
    if max(width, height) > FLOAT32_MAX_PIXELS:
        text = f"The image has {width} x {height} pixels, more than {FLOAT32_MAX_PIXELS} a side"
        raise InputError(text, "camera", Remedy.SMALLER_IMAGES)
    grid = visible_grid(camera, plane, stack, diameter_mm=working_diameter_mm, pitch_mm=pitch_mm)
    points = grid.points_mm()
    in_circle = np.linalg.norm(points - surface.axis_mm, axis=-1) <= working_diameter_mm / 2

    def seen_from(rows: slice) -> tuple[Float32Array, BoolArray, Float32Array]:
        """Return raw pixels, whether they are in the image, and ray slopes, for some rows."""
        directions = membrane_to_camera(points[rows], plane, stack, surface)
        pixels = camera.project(directions)
        inside = (
            (directions[..., 2] > 0.0)
            & (pixels >= 0.0).all(axis=-1)
            & (np.hypot(directions[..., 0], directions[..., 1]) < steepest * directions[..., 2])
            & (pixels[..., 0] <= camera.width - 1)
            & (pixels[..., 1] <= camera.height - 1)
        )
        _, ray_slope = camera_to_membrane(directions, plane, stack)
        visible_px = np.where(inside[..., None], pixels, -1.0)
        return visible_px.astype(np.float32), inside, ray_slope.astype(np.float32)

    # Just before a lens model folds, a hundredth of a pixel changes a ray by degrees.
    steepest = 0.9 * camera.fold
    # Fixed block size, independent of the number of threads, so that the table is always the same.
    blocks = [slice(first, first + BLOCK_ROWS) for first in range(0, grid.shape[0], BLOCK_ROWS)]
    pixels, inside, ray_slope = (
        np.concatenate(parts) for parts in zip(*in_parallel(seen_from, blocks), strict=True)
    )
    return ResamplingTable(
        grid,
        np.ascontiguousarray(pixels[..., 0]),
        np.ascontiguousarray(pixels[..., 1]),
        inside & in_circle,
        ray_slope,
        surface,
    )


def paraxial_footprint_mm(camera: CameraModel, stack: LayerStack) -> float:
    """Return the size of one raw pixel on the membrane at the origin of the sensor frame.

    Parameters
    ----------
    camera, stack
        Lens, and layers below the top surface.
    """
    apparent = sum(t / n for t, n in zip(stack.thicknesses_mm, stack.indices, strict=True))
    return apparent / max(camera.fx, camera.fy)


def visible_grid(
    camera: CameraModel,
    plane: TopPlane,
    stack: LayerStack,
    *,
    diameter_mm: float,
    pitch_mm: float | None = None,
) -> MembraneGrid:
    """Return the grid over the visible part of the working circle, in sizes suited to transforms.

    Parameters
    ----------
    camera, plane, stack, pitch_mm
        As in :func:`build_resampling_table`.
    diameter_mm : float
        Diameter of the working circle.

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
    points, _ = camera_to_membrane(camera.directions(border), plane, stack)
    valid = points[np.isfinite(points).all(axis=-1)]
    low = np.maximum(valid.min(axis=0, initial=np.inf), -diameter_mm / 2)
    high = np.minimum(valid.max(axis=0, initial=-np.inf), diameter_mm / 2)
    if not (high - low > 2 * pitch_mm).all():
        raise InputError(
            "The camera sees nothing of the working circle", "top_pose", Remedy.CHECK_LENGTHS
        )
    if not (high - low >= LEAST_NODES * pitch_mm).all():
        width, height = high - low
        text = (
            f"The visible part of the working circle is {width:.2f} x {height:.2f} mm, less than "
            f"{LEAST_NODES} pixels"
        )
        raise InputError(text, "sensor description", Remedy.CHECK_LENGTHS)
    nodes = float(np.prod((high - low) / pitch_mm + 2.0))
    if nodes > GRID_PER_IMAGE * camera.width * camera.height:
        text = f"The membrane grid would have {nodes:.1e} nodes"
        raise InputError(text, "camera", Remedy.CHECK_LENGTHS)
    axes = []
    for start, stop in zip(low, high, strict=True):
        # Multiples of four, so that a quarter-scale grid has whole nodes too, without prime factors
        # above 5, for fast transforms.
        quarter = int(np.ceil(((stop - start) / pitch_mm + 1.0) / 4.0))
        count = 4 * next_fast_len(quarter, real=True)
        centre = (start + stop) / 2
        axes.append(centre + pitch_mm * (np.arange(count) - (count - 1) / 2))
    return MembraneGrid(axes[0], axes[1], float(pitch_mm))


def node_pixels(table: ResamplingTable, nodes: Float64Array) -> Float64Array:
    """Return the raw pixels (M, 2) of fractional nodes (N, 2) (column, row).

    Nodes that the camera does not see are left out.
    """
    if len(nodes) == 0:
        return np.zeros((0, 2))
    position = np.asarray(nodes, np.float32).reshape(-1, 1, 2)
    visible = (table.u_px >= 0.0).astype(np.float32)
    u, v, weight = (
        cv2.remap(plane, position[..., 0], position[..., 1], cv2.INTER_LINEAR)[:, 0]
        for plane in (table.u_px, table.v_px, visible)
    )
    # Next to an invisible node, its -1 would be mixed in.
    return np.stack([u, v], axis=-1).astype(np.float64)[weight > 0.999]


def boundary_px(table: ResamplingTable) -> Float64Array:
    """Return the border of the working area (N, 2), in raw pixels."""
    borders, _ = cv2.findContours(
        table.valid.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    longest = max(borders, key=len)[::4, 0] if borders else np.zeros((0, 2))
    return node_pixels(table, np.asarray(longest, np.float64))


def working_area(table: ResamplingTable, shape: tuple[int, int]) -> BoolArray:
    """Return the working area as a mask (rows, columns) of the raw image."""
    area = np.zeros(shape, np.uint8)
    boundary = boundary_px(table)
    if len(boundary) > 2:
        cv2.fillPoly(area, [np.round(boundary).astype(np.int32)], (1.0,))
    return area > 0
