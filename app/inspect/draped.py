"""Lines laid on the surface in 3D: where they are seen, and which parts the relief hides."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from app.inspect.camera3d import Camera
from app.inspect.surface import Surface

Array = NDArray[np.float64]
Point = tuple[float, float]
STEP_MM = 0.12
MOST_POINTS = 400
# A line lies in the surface: what hides it must be higher by more than the mesh is coarse.
CLEAR_MM = 0.06
LOOKED_MM = np.linspace(0.4, 8.0, 24)
HALO = QColor(0, 0, 0, 150)


@dataclass(frozen=True, slots=True)
class DrapedLine:
    """A line on the surface.

    Attributes
    ----------
    points_mm : tuple of (x, y)
        Its corners.
    colour : str
        As Qt reads it.
    """

    points_mm: tuple[Point, ...]
    colour: str


def along(points_mm: tuple[Point, ...]) -> Array:
    """Return places (N, 2) along a line, close enough to follow the relief."""
    corners = np.asarray(points_mm, np.float64)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    if way[-1] <= 0.0:
        return corners[:1]
    count = min(max(int(way[-1] / STEP_MM), 1) + 1, MOST_POINTS)
    at = np.union1d(np.linspace(0.0, way[-1], count), way)
    return np.stack([np.interp(at, way, corners[:, k]) for k in (0, 1)], axis=-1)


def on_surface(places_mm: Array, surface: Surface, exaggeration: float) -> Array:
    """Return places (N, 2) as points (N, 3) of the scene; those off the surface are left out."""
    height = exaggeration * surface.depth_at(places_mm[:, 0], places_mm[:, 1])
    points = np.stack([places_mm[:, 0], -places_mm[:, 1], height], axis=-1)
    return points[np.isfinite(height)]


def hidden(points: Array, surface: Surface, camera: Camera, exaggeration: float) -> Array:
    """Return which points (N, 3) of the scene stand behind higher ones, (N,) bool."""
    towards = camera.position() - points
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    steps = points[:, None, :] + LOOKED_MM[:, None] * towards[:, None, :]
    heights = exaggeration * surface.depth_at(steps[..., 0], -steps[..., 1])
    return np.asarray((heights > steps[..., 2] + CLEAR_MM * max(exaggeration, 1.0)).any(axis=1))


def draw_line(
    painter: QPainter,
    line: DrapedLine,
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    exaggeration: float,
) -> None:
    """Draw a line on the surface; what the relief hides is dotted."""
    points = on_surface(along(line.points_mm), surface, exaggeration)
    if len(points) < 2:
        return
    behind = hidden(points, surface, camera, exaggeration)
    seen = [QPointF(float(x), float(y)) for x, y in camera.project(points, size)]
    changes = np.flatnonzero(np.diff(behind)) + 1
    edges = [0, *changes.tolist(), len(seen)]
    for first, last in pairwise(edges):
        part = QPolygonF(seen[max(first - 1, 0) : last])
        pens = [QPen(HALO, 3.6), QPen(QColor(line.colour), 1.8)]
        if behind[first]:
            pens = [QPen(QColor(line.colour), 1.2, Qt.PenStyle.DotLine)]
        for pen in pens:
            painter.setPen(pen)
            painter.drawPolyline(part)
