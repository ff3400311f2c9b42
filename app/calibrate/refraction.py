"""The contact of a ball before and after the correction of lens, tilt and refraction."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import read_raw
from app.calibrate.maps import Panel
from app.view2d.map_view import Extent
from gelpolight_core.calibration.ball_stage import BALLS
from gelpolight_core.calibration.open_sensor import TOP_POSE
from gelpolight_core.calibration.project import Project
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.translation import tr

Rgb = NDArray[np.uint8]
CLOSE_UP = 1.6
CLOSE_UP_PX = 420


def refraction_panels(
    raw: NDArray[Any], press: BallPress, table: ResamplingTable
) -> tuple[Panel, ...]:
    """Return a ball's contact in the raw image and on the rectified grid (the paper's Fig. 6).

    Parameters
    ----------
    raw : (rows, columns, 3) uint8 or uint16
        The capture.
    press : BallPress
        The press found in it.
    table : ResamplingTable
        Of the session.
    """
    found = press.indentation
    edge = found.contour.astype(np.float32).reshape(-1, 1, 2)
    seen_u = cv2.remap(table.u_px, edge[..., 0], edge[..., 1], cv2.INTER_LINEAR)
    seen_v = cv2.remap(table.v_px, edge[..., 0], edge[..., 1], cv2.INTER_LINEAR)
    before = np.concatenate([seen_u, seen_v], axis=1)
    eight = (raw >> 8).astype(np.uint8) if raw.dtype == np.uint16 else raw
    flat = table.apply(eight.astype(np.float32) / np.float32(255.0))
    after = (255.0 * np.clip(flat, 0.0, 1.0)).astype(np.uint8)
    text = tr("axis ratio {a:.3f} : 1")
    grid = table.grid
    seen, seen_extent = _close_up(eight, before, ellipse=True)
    flat_view, at = _close_up(after, found.contour, ellipse=False)
    x, y, pitch = float(grid.x_mm[0]), float(grid.y_mm[0]), grid.pitch_mm
    left, top, right, bottom = (pitch * edge for edge in at)
    return (
        Panel(
            tr("Raw camera image"),
            seen,
            seen_extent,
            in_mm=False,
            caption=text.format(a=_axes(before)),
        ),
        Panel(
            tr("Lens, tilt and refraction corrected"),
            flat_view,
            (x + left, y + top, x + right, y + bottom),
            caption=text.format(a=_axes(found.contour)),
        ),
    )


def _axes(points: NDArray[Any]) -> float:
    (_, (one, other), _) = cv2.fitEllipseDirect(points.astype(np.float32).reshape(-1, 1, 2))
    return max(one, other) / max(min(one, other), 1e-9)


def _close_up(rgb: Rgb, points: NDArray[Any], *, ellipse: bool) -> tuple[Rgb, Extent]:
    """Return an enlarged view of a contour with the curve fitted to it, and its outer edges."""
    centre = points.mean(axis=0)
    reach = CLOSE_UP * float(np.linalg.norm(points - centre, axis=1).max())
    scale = CLOSE_UP_PX / (2.0 * reach)
    shift = CLOSE_UP_PX / 2.0 - scale * centre
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    near = cv2.warpAffine(rgb, matrix, (CLOSE_UP_PX, CLOSE_UP_PX), flags=cv2.INTER_LINEAR)
    near = cv2.convertScaleAbs(near, alpha=220.0 / max(float(np.percentile(near, 99.5)), 1.0))
    at = (scale * points + shift).astype(np.float32)
    for u, v in at:
        cv2.circle(near, (round(float(u)), round(float(v))), 2, (255, 220, 60), -1, cv2.LINE_AA)
    if ellipse:
        box = cv2.fitEllipseDirect(at.reshape(-1, 1, 2))
        cv2.ellipse(near, box, (255, 255, 255), 1, cv2.LINE_AA)
    else:
        u, v, radius = _fit_circle(at)
        cv2.circle(near, (round(u), round(v)), round(radius), (255, 255, 255), 1, cv2.LINE_AA)
    left, top, right, bottom = np.concatenate(
        [(edge - shift) / scale for edge in (-0.5, CLOSE_UP_PX - 0.5)]
    ).tolist()
    return np.asarray(near, np.uint8), (left, top, right, bottom)


def _fit_circle(points: NDArray[Any]) -> tuple[float, float, float]:
    """Return centre and radius of a circle fitted to points; the circle may be incomplete."""
    middle = points.mean(axis=0)
    away = (points - middle).astype(np.float64)
    sides = np.column_stack([2.0 * away, np.ones(len(away))])
    (u, v, rest), *_ = np.linalg.lstsq(sides, (away**2).sum(axis=1), rcond=None)
    return float(middle[0] + u), float(middle[1] + v), math.sqrt(rest + u * u + v * v)


def most_oblique_press(project: Project) -> tuple[Panel, ...]:
    """Return the press nearest to the edge before and after the correction; nothing without one.

    Raises
    ------
    InputError
        If its image cannot be read.
    """
    balls, top = project.results.get(BALLS), project.results.get(TOP_POSE)
    if balls is None or top is None or not balls.presses:
        return ()
    found = {ball.file: ball.press for ball in balls.seen if ball.press is not None}
    name = max(found, key=lambda n: sum(c * c for c in found[n].pose.centre_mm))
    raw = read_raw(project.session.folder / BALLS.folder / name)
    return refraction_panels(raw, found[name], top.table)
