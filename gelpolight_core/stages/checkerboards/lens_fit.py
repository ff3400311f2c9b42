"""Fit a lens to corners: with all views at once, and again without some of them.

Zhang's method as solved by OpenCV: pinhole, k1 k2 p1 p2, k3 = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError

from .checkerboard import BoardView
from .lens_views import more_views_advice


@dataclass(frozen=True, slots=True)
class LensFit:
    """Solution of a lens calibration.

    Attributes
    ----------
    values, sd : (9,)
        fx, fy, cx, cy, k1, k2, p1, p2, k3 and their formal standard deviations.
    rotations : tuple of (3, 3)
        From board to camera, per view.
    shifts_mm : tuple of (3,)
        The board's origin in the camera frame, per view.
    view_rms_px : (V,)
        Reprojection error per view.
    rms_px : float
        Over all corners of all views, both coordinates together.
    """

    values: Float64Array
    sd: Float64Array
    rotations: tuple[Float64Array, ...]
    shifts_mm: tuple[Float64Array, ...]
    view_rms_px: Float64Array
    rms_px: float

    @property
    def matrix(self) -> Float64Array:
        """(3, 3) pinhole matrix."""
        fx, fy, cx, cy = self.values[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class HeldOutViews:
    """Cameras calibrated without a group of views.

    Attributes
    ----------
    values : (G, 9)
        Their intrinsics, as in :class:`LensFit`.
    view_rms_px : (V,)
        Reprojection error of each view for the camera calibrated without it; NaN if there is none.
    """

    values: Float64Array
    view_rms_px: Float64Array

    @property
    def sd(self) -> Float64Array:
        """Jackknife standard deviation of each value."""
        groups = len(self.values)
        return np.asarray(np.sqrt((groups - 1.0) * np.var(self.values, axis=0)))


def solve_from_scratch(views: Sequence[BoardView], size: tuple[int, int]) -> LensFit:
    """Solve from Zhang's closed form and from a simple guess, and return the better solution.

    Parameters
    ----------
    views : sequence of BoardView
        The views to use.
    size : (width, height)
        Size of the images.

    Returns
    -------
    LensFit
        With fx and fy free.

    Raises
    ------
    InputError
        If no camera fits the views.
    """
    # The simple guess: field of view as wide as the distance, axis through the image centre.
    centre = [(size[0] - 1) / 2.0, (size[1] - 1) / 2.0]
    values = np.array([float(max(size)), float(max(size)), *centre, 0.0, 0.0, 0.0, 0.0, 0.0])
    guess = LensFit(values, np.zeros(9), (), (), np.zeros(0), math.inf)
    fits = [solve_lens(views, size, start=start, square_pixels=False) for start in (None, guess)]
    solved = [fit for fit in fits if fit is not None and np.isfinite(fit.values).all()]
    if not solved:
        raise InputError("No camera model fits the views", "checkerboard", more_views_advice())
    return min(solved, key=lambda fit: fit.rms_px)


@contextmanager
def _one_opencv_thread() -> Iterator[None]:
    """Run OpenCV in one thread: with several, sums depend on the order in which they finish.

    The same images must give exactly the same lens on every machine.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def solve_lens(
    views: Sequence[BoardView], size: tuple[int, int], *, start: LensFit | None, square_pixels: bool
) -> LensFit | None:
    """Solve all views at once.

    Parameters
    ----------
    views : sequence of BoardView
        The views to use.
    size : (width, height)
        Size of the images.
    start : LensFit or None
        Start values; Zhang's closed form if None.
    square_pixels : bool
        Whether fx = fy is kept.

    Returns
    -------
    LensFit or None
        None if OpenCV finds the views degenerate.
    """
    flags = cv2.CALIB_FIX_K3
    matrix, distortion = np.eye(3), np.zeros(5)
    if start is not None:
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS
        matrix, distortion = start.matrix, start.values[4:].copy()
    if square_pixels:
        # OpenCV keeps the ratio of the guess.
        matrix[0, 0] = matrix[1, 1] = 0.5 * (matrix[0, 0] + matrix[1, 1])
        flags |= cv2.CALIB_FIX_ASPECT_RATIO
    try:
        with _one_opencv_thread():
            rms, pinhole, bent, rotations, shifts, sd, _, view_rms = cv2.calibrateCameraExtended(
                [view.board.points_mm.astype(np.float32) for view in views],
                [view.corners_px.astype(np.float32) for view in views],
                size,
                matrix,
                distortion,
                flags=flags,
            )
    except cv2.error:
        return None
    focal_and_centre = pinhole[0, 0], pinhole[1, 1], pinhole[0, 2], pinhole[1, 2]
    values = np.array([*focal_and_centre, *bent.ravel()[:5]])
    sds = np.asarray(sd, dtype=np.float64).ravel()[:9].copy()
    if square_pixels:
        sds[:2] = sds[:2].max()
    return LensFit(
        values,
        sds,
        tuple(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64) for turn in rotations),
        tuple(np.asarray(shift, dtype=np.float64).ravel() for shift in shifts),
        np.asarray(view_rms, dtype=np.float64).ravel(),
        float(rms),
    )


def hold_out(
    views: Sequence[BoardView], size: tuple[int, int], fit: LensFit, *, square_pixels: bool
) -> HeldOutViews:
    """Calibrate without each group of views, and check that camera on those views.

    Parameters
    ----------
    views : sequence of BoardView
        The views of `fit`.
    size : (width, height)
        Size of the images.
    fit : LensFit
        The solution with all views, as start values.
    square_pixels : bool
        Whether fx = fy is kept.

    Returns
    -------
    HeldOutViews
        Without the groups whose remaining views are degenerate.
    """
    groups = min(len(views), 12)
    group_of = np.arange(len(views)) % groups
    values = []
    view_rms = np.full(len(views), np.nan)
    for group in range(groups):
        remaining = [view for view, g in zip(views, group_of, strict=True) if g != group]
        partial_fit = solve_lens(remaining, size, start=fit, square_pixels=square_pixels)
        if partial_fit is None:
            continue
        values.append(partial_fit.values)
        for index in map(int, np.flatnonzero(group_of == group)):
            view_rms[index] = _rms_of_pose(views[index], partial_fit)
    return HeldOutViews(np.array(values).reshape(-1, 9), view_rms)


def _rms_of_pose(view: BoardView, fit: LensFit) -> float:
    points, distortion = view.board.points_mm, fit.values[4:]
    _, turn, shift = cv2.solvePnP(points, view.corners_px, fit.matrix, distortion)
    turn, shift = cv2.solvePnPRefineLM(points, view.corners_px, fit.matrix, distortion, turn, shift)
    projected, _ = cv2.projectPoints(points, turn, shift, fit.matrix, distortion)
    residual_px = np.asarray(projected, dtype=np.float64).reshape(-1, 2) - view.corners_px
    return float(np.sqrt(np.mean(np.sum(residual_px**2, axis=1))))


def aspect_is_significant(
    free: LensFit, shared: LensFit, held_out: HeldOutViews, views: Sequence[BoardView]
) -> bool:
    """Whether fx and fy differ by three standard deviations, formally and over the views.

    Cameras have square pixels; a difference must exceed both the noise of the corners and the
    scatter of the views.

    Parameters
    ----------
    free, shared : LensFit
        Solutions with fx and fy free, and with fx = fy.
    held_out : HeldOutViews
        Held-out views of `free`.
    views : sequence of BoardView
        The views of both.
    """
    corners = sum(len(view.corners_px) for view in views)
    freedom = max(2 * corners - 8 - 6 * len(views), 1)
    gain = freedom * (shared.rms_px**2 / max(free.rms_px**2, 1e-30) - 1.0)
    ratios = held_out.values[:, 0] / held_out.values[:, 1]
    scatter = math.sqrt((len(ratios) - 1.0) * float(np.var(ratios)))
    return gain > 9.0 and abs(free.values[0] / free.values[1] - 1.0) > 3.0 * scatter


def normal_spread_deg(fit: LensFit) -> float:
    """Return the RMS angle of the board normals about their mean.

    Parameters
    ----------
    fit : LensFit
        One rotation per view.
    """
    normals = np.stack([r[:, 2] if r[2, 2] > 0.0 else -r[:, 2] for r in fit.rotations])
    mean = normals.mean(axis=0)
    mean /= np.linalg.norm(mean)
    angles = np.arccos(np.clip(normals @ mean, -1.0, 1.0))
    return math.degrees(float(np.sqrt(np.mean(angles**2))))
