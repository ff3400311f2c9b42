"""The contact of a ball before and after the correction of lens, tilt and refraction."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import read_raw
from app.calibrate.maps import Panel
from gelpolight_core.calibration.ball_stage import BALLS
from gelpolight_core.calibration.open_sensor import TOP_POSE
from gelpolight_core.calibration.project import Project
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.translation import tr

CLOSE_UP = 1.6
ORIGIN = np.zeros(2)


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
    edge = press.indentation.contour.astype(np.float32).reshape(-1, 1, 2)
    before = np.concatenate(
        [
            cv2.remap(positions, edge[..., 0], edge[..., 1], cv2.INTER_LINEAR)
            for positions in (table.u_px, table.v_px)
        ],
        axis=1,
    )
    eight = (raw >> 8).astype(np.uint8) if raw.dtype == np.uint16 else raw
    flat = table.apply(eight.astype(np.float32) / np.float32(255.0))
    after = (255.0 * np.clip(flat, 0.0, 1.0)).astype(np.uint8)
    grid = table.grid
    corner_mm = np.array([grid.x_mm[0], grid.y_mm[0]])
    return (
        _close_up(tr("Raw camera image"), eight, before, in_mm=False),
        _close_up(
            tr("Lens, tilt and refraction corrected"), after, press.indentation.contour,
            origin=corner_mm, pitch=grid.pitch_mm,
        ),
    )  # fmt: skip


def _close_up(
    title: str,
    rgb: NDArray[np.uint8],
    points: NDArray[Any],
    *,
    origin: NDArray[np.float64] = ORIGIN,
    pitch: float = 1.0,
    in_mm: bool = True,
) -> Panel:
    """Return the part of an image around a contour, with the contour and its axis ratio."""
    centre = points.mean(axis=0)
    reach = CLOSE_UP * float(np.linalg.norm(points - centre, axis=1).max())
    low = np.maximum(np.round(centre - reach).astype(int), 0)
    high = np.minimum(np.round(centre + reach).astype(int) + 1, rgb.shape[1::-1])
    near = rgb[low[1] : high[1], low[0] : high[0]]
    bright = cv2.convertScaleAbs(near, alpha=220.0 / max(float(np.percentile(near, 99.5)), 1.0))
    _, axes, _ = cv2.fitEllipseDirect(points.astype(np.float32).reshape(-1, 1, 2))
    ratio = max(axes) / max(min(axes), 1e-9)
    left, top, right, bottom = np.concatenate(
        [origin + pitch * (at - 0.5) for at in (low, high)]
    ).tolist()
    return Panel(
        title,
        np.asarray(bright, np.uint8),
        (left, top, right, bottom),
        in_mm=in_mm,
        caption=tr("axis ratio {a:.3f} : 1").format(a=ratio),
        outline_mm=origin + pitch * points.astype(np.float64),
    )


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
