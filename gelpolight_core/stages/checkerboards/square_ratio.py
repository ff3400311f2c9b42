"""Squares of a board that are longer along one side than along the other, as of some printers.

One ratio of the two sides is fitted with the poses of the board and, from the views of the lens,
with the lens. It has an effect of its own: pixels that are not square stretch all boards along one
direction of the image, and foreshortening comes with perspective.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import Remedy
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.session.board import BoardSpec

from .checkerboard import BoardView

ROUNDS = 3
SIGMAS = 3.0
RANGE = (0.8, 1.25)
"""No print is stretched by more."""
WARN_PERCENT, FAIL_PERCENT = 0.5, 1.0
"""Lines of a good print are accurate to half a percent of a square. The side that is not as stated
makes lengths along it wrong by the whole difference, and no distance may be wrong by 1 %."""
LENS_VALUES = 8
"""fx, fy, cx, cy, k1, k2, p1, p2."""


@dataclass(frozen=True, slots=True)
class SquareRatio:
    """Distance of a board's rows over that of its columns.

    Attributes
    ----------
    value, sd : float
        With its standard deviation: the larger of that by the corners' scatter and by that of the
        views.
    """

    value: float
    sd: float

    @property
    def difference_percent(self) -> float:
        """Difference of the two sides, percent of the longer one."""
        return 100.0 * (1.0 - min(self.value, 1.0 / self.value))


def fit_square_ratio(
    views: Sequence[BoardView], camera: CameraModel, *, lens_known: bool
) -> SquareRatio:
    """Fit the ratio to corners, with the poses and, if it is not known, with the lens.

    Parameters
    ----------
    views : sequence of BoardView
        Views of one board.
    camera : CameraModel
        The lens, as it fits best to a board with square squares.
    lens_known : bool
        Whether it was fitted to other views.
    """
    free = np.zeros((LENS_VALUES, 0)) if lens_known else np.eye(LENS_VALUES)
    ratio = 1.0
    # Gauss and Newton; each round finds the poses for the ratio of the one before.
    for _ in range(ROUNDS):
        equations = [_normal(view, camera, ratio, free) for view in views]
        normals, sides, squares = zip(*equations, strict=True)
        normal, side = np.sum(normals, axis=0), np.sum(sides, axis=0)
        inverse = np.linalg.pinv(normal, hermitian=True)
        change = inverse @ side
        ratio = float(np.clip(ratio + change[-1], *RANGE))
    freedom = sum(2 * len(view.corners_px) - 6 for view in views) - len(side)
    variance = max(float(np.sum(squares) - side @ change), 0.0) / max(freedom, 1)
    sd = math.sqrt(variance * float(inverse[-1, -1]))
    if len(views) > 2:
        # Jackknife, because bends of the board are no noise of the corners.
        without = [
            (np.linalg.pinv(normal - n, hermitian=True) @ (side - s))[-1]
            for n, s in zip(normals, sides, strict=True)
        ]
        sd = max(sd, math.sqrt((len(views) - 1.0) * float(np.var(without))))
    return SquareRatio(ratio, sd)


def _normal(
    view: BoardView, camera: CameraModel, ratio: float, free: Float64Array
) -> tuple[Float64Array, Float64Array, float]:
    """Return the normal equations of lens and ratio by one view, and its square error.

    They hold for the pose that fits best. The lens changes along the columns of `free`, (8, F).
    """
    points = view.board.points_mm * np.array([1.0, ratio, 1.0])
    corners, lens = view.corners_px, (camera.matrix, np.array(camera.distortion))
    _, turns, shifts, _ = cv2.solvePnPGeneric(points, corners, *lens, flags=cv2.SOLVEPNP_IPPE)
    turn, shift = cv2.solvePnPRefineLM(points, corners, *lens, turns[0], shifts[0])
    shown, slopes = cv2.projectPoints(points, turn, shift, *lens)
    error = (corners - np.asarray(shown, np.float64).reshape(-1, 2)).ravel()
    # Columns: turn, shift, fx, fy, cx, cy, distortion.
    along = np.outer(view.board.points_mm[:, 1], cv2.Rodrigues(turn)[0][:, 1])
    by_ratio = np.einsum("nij,nj->ni", slopes[:, 3:6].reshape(-1, 2, 3), along).ravel()
    columns = np.column_stack([slopes[:, 6 : 6 + LENS_VALUES] @ free, by_ratio])
    pose, _ = np.linalg.qr(slopes[:, :6])
    columns -= pose @ (pose.T @ columns)
    error -= pose @ (pose.T @ error)
    return columns.T @ columns, columns.T @ error, float(error @ error)


def judge_square_ratio(ratio: SquareRatio, board: BoardSpec) -> tuple[Finding, ...]:
    """Judge the squares of a board.

    There is no figure if they are square, or if the views cannot tell what would fail.

    Parameters
    ----------
    ratio : SquareRatio
        As fitted.
    board : BoardSpec
        The board as stated; its longer side is as stated.
    """
    percent, sd_percent = ratio.difference_percent, 100.0 * ratio.sd
    across = board.square_mm * min(1.0, 1.0 / ratio.value)
    down = board.square_mm * min(1.0, ratio.value)
    figure = judge(
        "squares_percent",
        f"Squares of the board are {across:.2f} x {down:.2f} mm"
        f" (\N{PLUS-MINUS SIGN} {sd_percent:.1g} %), difference of the sides",
        percent,
        "%",
        warn=WARN_PERCENT,
        fail=FAIL_PERCENT,
        remedy=Remedy.SQUARE_BOARD,
    )
    least_percent = SIGMAS * sd_percent
    shown = least_percent < FAIL_PERCENT and percent > max(least_percent, WARN_PERCENT)
    return (figure,) if shown else ()
