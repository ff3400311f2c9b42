"""Checkerboards in front of the virtual camera: patterns, poses and their images, in air."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .design_parts import CameraDesign, LayerDesign
from .rays import bands, pixel_directions, project_to_pixels, sensor_axes
from .simulation_kernel import Interrupt, compiled, never_interrupt

WHITE, BLACK, ROOM = 200.0 / 255.0, 9.5 / 255.0, 58.7 / 255.0
"""Brightness of printed white, printed black and the area behind a board under room light."""
DARK_ROOM = 2.2 / 255.0
"""Brightness next to the working circle when the board lies on top of the sensor."""

INNER_CORNERS = (9, 6)
VIEW_SQUARE_MM, TOP_SQUARE_MM = 3.0, 2.0
"""Both boards, and the squares of the one held by hand and of the one on the top surface."""


@dataclass(frozen=True, slots=True)
class BoardPose:
    """A checkerboard in space.

    Attributes
    ----------
    inner_corners : (columns, rows)
        Inner corners of the pattern.
    square_mm : float
        Side of a square.
    axes : (3, 3)
        Rows: the board's x, y and normal in the camera frame.
    centre_mm : (3,)
        Centre of the pattern, camera frame.
    disc_radius_mm : float
        The board is visible inside this circle around `disc_centre_mm`; if infinite, the board is a
        rectangle with a white border of one square.
    disc_centre_mm : (2,)
        In the board's x and y.
    """

    inner_corners: tuple[int, int]
    square_mm: float
    axes: Float64Array
    centre_mm: Float64Array
    disc_radius_mm: float = math.inf
    disc_centre_mm: tuple[float, float] = (0.0, 0.0)

    def corners_mm(self) -> Float64Array:
        """(rows * columns, 3) inner corners in the camera frame, row by row."""
        columns, rows = self.inner_corners
        y, x = np.mgrid[:rows, :columns].astype(np.float64)
        x = (x.ravel() - 0.5 * (columns - 1)) * self.square_mm
        y = (y.ravel() - 0.5 * (rows - 1)) * self.square_mm
        return np.asarray(self.centre_mm + x[:, None] * self.axes[0] + y[:, None] * self.axes[1])


@compiled
def _board_value(
    x: float, y: float, columns: int, rows: int, square: float
) -> float:  # pragma: no cover - compiled
    """Return 0 for black, 1 for white, -1 outside the board, about the pattern's centre."""
    a, b = x / square + 0.5 * (columns + 1), y / square + 0.5 * (rows + 1)
    if 0.0 <= a < columns + 1 and 0.0 <= b < rows + 1:
        return float((math.floor(a) + math.floor(b)) % 2)
    if -1.0 <= a < columns + 2 and -1.0 <= b < rows + 2:
        return 1.0
    return -1.0


@compiled
def _draw(
    directions: Any, axes: Any, centre: Any, board: Any, disc: Any, levels: Any, samples: int
) -> Any:  # pragma: no cover - compiled
    height, width = directions.shape[0] - 1, directions.shape[1] - 1
    columns, rows, square = board
    out = np.empty((height, width))
    distance = centre[0] * axes[2, 0] + centre[1] * axes[2, 1] + centre[2] * axes[2, 2]
    for i in range(height):
        for j in range(width):
            total = 0.0
            for part in range(samples * samples):
                a = (part // samples + 0.5) / samples
                b = (part % samples + 0.5) / samples
                x = (1 - a) * ((1 - b) * directions[i, j, 0] + b * directions[i, j + 1, 0])
                x += a * ((1 - b) * directions[i + 1, j, 0] + b * directions[i + 1, j + 1, 0])
                y = (1 - a) * ((1 - b) * directions[i, j, 1] + b * directions[i, j + 1, 1])
                y += a * ((1 - b) * directions[i + 1, j, 1] + b * directions[i + 1, j + 1, 1])
                scale = distance / (x * axes[2, 0] + y * axes[2, 1] + axes[2, 2])
                px, py, pz = x * scale - centre[0], y * scale - centre[1], scale - centre[2]
                u = px * axes[0, 0] + py * axes[0, 1] + pz * axes[0, 2]
                v = px * axes[1, 0] + py * axes[1, 1] + pz * axes[1, 2]
                value = _board_value(u, v, columns, rows, square)
                if scale <= 0.0:
                    value = -1.0
                elif disc[2] < 1e300:
                    outside = math.hypot(u - disc[0], v - disc[1]) > disc[2]
                    value = -1.0 if outside else abs(value)
                level = levels[2]
                if value >= 0.0:
                    level = levels[0] if value > 0.5 else levels[1]
                total += level
            out[i, j] = total / (samples * samples)
    return out


def board_image(
    camera: CameraDesign, pose: BoardPose, *, interrupt: Interrupt = never_interrupt
) -> Float64Array:
    """Return (rows, columns): the board's brightness at each pixel, without blur and noise.

    Parameters
    ----------
    camera : CameraDesign
        The lens.
    pose : BoardPose
        Pose of the board.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.
    """
    disc = (*pose.disc_centre_mm, min(pose.disc_radius_mm, 1e308))
    round_board = math.isfinite(pose.disc_radius_mm)
    levels = (WHITE, BLACK, DARK_ROOM if round_board else ROOM)
    board = (*pose.inner_corners, pose.square_mm)
    out = np.empty((camera.height_px, camera.width_px))
    for start, stop in bands(0, camera.height_px):
        interrupt()
        # Directions at the pixel corners: within a pixel the lens is linear to 1e-8.
        v, u = np.mgrid[start : stop + 1, : camera.width_px + 1] - 0.5
        directions = pixel_directions(camera, u, v)
        out[start:stop] = _draw(directions, pose.axes, pose.centre_mm, board, disc, levels, 4)
    return out


def _turned(rx: float, ry: float, rz: float) -> Float64Array:
    """Return board axes (rows) after rotation about z, then y, then x."""
    cx, sx, cy, sy = math.cos(rx), math.sin(rx), math.cos(ry), math.sin(ry)
    cz, sz = math.cos(rz), math.sin(rz)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
    about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    about_z = np.array([[cz, sz, 0.0], [-sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def board_views(camera: CameraDesign, rng: np.random.Generator) -> tuple[BoardPose, ...]:
    """Return 16 poses of a hand-held board with all its inner corners in the image.

    The board is tilted by up to 32 degrees, fills half to nine tenths of the image width, and is
    shifted towards the four corners in turn, so that all views together reach the image borders.

    Parameters
    ----------
    camera : CameraDesign
        The lens.
    rng : Generator
        Source of the poses.
    """
    length = (INNER_CORNERS[0] + 1) * VIEW_SQUARE_MM
    size = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    poses = []
    for number in range(16):
        for _ in range(10_000):
            share = rng.uniform(0.5, 0.9)
            distance = length * camera.fx / (share * camera.width_px)
            side = np.array([2 * (number % 2) - 1, 2 * (number // 2 % 2) - 1])
            margin = size - np.array([1.0, 0.8]) * share * camera.width_px
            u, v = 0.5 * size + 0.5 * side * rng.uniform(0.0, 1.0, 2) * np.maximum(margin, 0.0)
            direction = pixel_directions(camera, np.array(u), np.array(v))
            tilt = rng.uniform(-1.0, 1.0, 2) * math.radians(32.0)
            axes = _turned(tilt[0], tilt[1], math.radians(rng.uniform(-25.0, 25.0)))
            pose = BoardPose(INNER_CORNERS, VIEW_SQUARE_MM, axes, distance * direction)
            if _in_image(camera, pose):
                poses.append(pose)
                break
    return tuple(poses)


def _in_image(camera: CameraDesign, pose: BoardPose) -> bool:
    corners = pose.corners_mm()
    if corners[:, 2].min() <= 0.0:
        return False
    room = 0.02 * camera.width_px
    # One square of margin, so that the squares around the outer corners are completely visible.
    centre = corners.mean(axis=0)
    pixels = project_to_pixels(camera, centre + 1.35 * (corners - centre))
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    size = np.array([camera.width_px, camera.height_px])
    return bool((low > room - 0.5).all() and (high < size - 0.5 - room).all())


def board_on_top(
    layers: LayerDesign,
    *,
    working_diameter_mm: float,
    axis_mm: tuple[float, float] = (0.0, 0.0),
    yaw_deg: float = 14.0,
    shift_mm: tuple[float, float] = (0.35, -0.25),
) -> BoardPose:
    """Return the pose of the small board that lies on the sensor's top surface."""
    yaw = math.radians(yaw_deg)
    frame = sensor_axes(layers)
    rotation = np.array(
        [[math.cos(yaw), math.sin(yaw), 0.0], [-math.sin(yaw), math.cos(yaw), 0.0], [0, 0, 1.0]]
    )
    centre = np.array([*np.add(axis_mm, shift_mm), layers.top_distance_mm]) @ frame
    offset = -(rotation[:2, :2] @ np.array(shift_mm))
    return BoardPose(
        INNER_CORNERS,
        TOP_SQUARE_MM,
        rotation @ frame,
        np.asarray(centre),
        0.5 * working_diameter_mm,
        (float(offset[0]), float(offset[1])),
    )
