"""Calibrate the lens from checkerboard views: intrinsics, their uncertainty, and unused views.

Zhang's method as solved by OpenCV (pinhole, k1 k2 p1 p2, k3 = 0), with additional checks: each view
is checked separately, duplicates and outliers are left out by name, the uncertainty is the larger
of the formal one and of the jackknife over views, and every view is also judged by a camera that
was calibrated without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.image.linear_image import LinearImage, require_size
from gelpolight_core.session.board import BoardSpec

from .lens_fit import (
    LensFit,
    aspect_is_significant,
    hold_out,
    normal_spread_deg,
    solve_from_scratch,
    solve_lens,
)
from .lens_quality import coverage_counts, fit_figures, refuse_unobservable, view_figures
from .lens_views import (
    MIN_VIEWS,
    LensRefusal,
    LensView,
    find_view,
    leave_out_duplicates,
    more_views_advice,
    refused_view,
    require_views,
)
from .square_ratio import fit_square_ratio, judge_square_ratio

# A view that is this much worse than the median view does not agree with the others,
OUTLIER_RATIO = 3.0
# if it is also worse than the error of a good print and a good fit.
OUTLIER_LEAST_PX = 0.1


@dataclass(frozen=True, slots=True)
class LensResult:
    """The calibrated lens.

    Attributes
    ----------
    camera : CameraModel
        The intrinsics.
    sd : (9,)
        Standard deviations of fx, fy, cx, cy in pixels, and of k1, k2, p1, p2, k3.
    views : tuple of LensView
        All images, used or not, in the given order.
    coverage_map : (6, 8) int
        Number of corners in each part of the image.
    quality : QualityTable
        The judged figures.
    """

    camera: CameraModel
    sd: Float64Array
    views: tuple[LensView, ...]
    coverage_map: NDArray[np.int64]
    quality: QualityTable


def calibrate_lens(
    images: Sequence[LinearImage],
    board: BoardSpec,
    *,
    refused: Mapping[str, InputError] | None = None,
) -> LensResult:
    """Calibrate the lens from views of one checkerboard at different tilts.

    Parameters
    ----------
    images : sequence of LinearImage
        At least 4 usable; best are 10 to 20, tilted by 15 to 40 degrees and covering the whole
        image.
    board : BoardSpec
        The board in all of them.
    refused : mapping of str to InputError, optional
        Images that cannot be used at all, by name: they become unused views.

    Returns
    -------
    LensResult
        Camera, uncertainty, and the views used. A blurred, failed, duplicate or outlying view among
        good ones is left out and named.

    Raises
    ------
    InputError
        If images differ in size, fewer than 4 views are left, the views are too nearly parallel to
        give a focal length, or the intrinsics cannot be those of a camera.
    """
    size = _common_size(images)
    views = leave_out_duplicates(list(in_parallel(lambda image: find_view(image, board), images)))
    views += [refused_view(name, fault) for name, fault in (refused or {}).items()]
    try:
        return _solve(views, size)
    except LensRefusal:
        raise
    except InputError as fault:
        raise LensRefusal(fault, views) from fault


def _solve(views: list[LensView], size: tuple[int, int]) -> LensResult:
    require_views(views)
    views, fit = _solve_without_outliers(views, size)
    boards = [view.board for view in views if view.used and view.board is not None]
    held_out = hold_out(boards, size, fit, square_pixels=False)
    shared = solve_lens(boards, size, start=fit, square_pixels=True)
    if shared is not None and not aspect_is_significant(fit, shared, held_out, boards):
        fit = shared
        held_out = hold_out(boards, size, fit, square_pixels=True)
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = map(float, fit.values)
    camera = CameraModel(*size, fx, fy, cx, cy, (k1, k2, p1, p2, k3))
    spread_deg = normal_spread_deg(fit)
    sd = np.maximum(fit.sd, held_out.sd)
    nonsense = find_nonsense(camera)
    squares: tuple[Finding, ...] = ()
    if nonsense is None:
        ratio = fit_square_ratio(boards, camera, lens_known=False)
        squares = judge_square_ratio(ratio, boards[0].board)
    try:
        for figure in squares:
            if figure.verdict is Verdict.FAIL:
                raise InputError(figure.stated, "checkerboard", figure.remedy)
        refuse_unobservable(sd, fit, spread_deg)
        if nonsense is not None:
            raise InputError(nonsense, "checkerboard", more_views_advice())
    except InputError as fault:
        raise LensRefusal(fault, views) from fault
    described = _describe_views(views, fit, camera)
    coverage_map = coverage_counts(boards, size)
    coverage = float(np.mean(coverage_map > 0))
    held_out_rms = float(np.sqrt(np.mean(held_out.view_rms_px**2)))
    figures = (
        *squares,
        *fit_figures(fit, held_out_rms, sd, camera),
        *view_figures(described, coverage, spread_deg),
    )
    return LensResult(camera, sd, described, coverage_map, QualityTable(figures))


def find_nonsense(camera: CameraModel) -> str | None:
    """Return a description of what is impossible in a camera's intrinsics, or None.

    Parameters
    ----------
    camera : CameraModel
        From this or another program.
    """
    values = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
    if not np.isfinite(values).all():
        return "The intrinsics contain values that are not numbers"
    longest = max(camera.width, camera.height)
    # From 150 degrees of a fisheye, which no pinhole model describes, down to 3 degrees.
    fx, fy = camera.fx, camera.fy
    if not 0.13 * longest < min(fx, fy) <= max(fx, fy) < 20.0 * longest:
        return f"Focal lengths of {fx:.0f} and {fy:.0f} px are implausible for {longest} px"
    if abs(fx / fy - 1.0) > 0.1:
        text = f"Implausible pixel aspect ratio: fx {fx:.0f} and fy {fy:.0f} px"
        return f"{text} differ by more than 10 %"
    if not (0.0 < camera.cx < camera.width and 0.0 < camera.cy < camera.height):
        return f"The principal point ({camera.cx:.0f}, {camera.cy:.0f}) is outside the image"
    return _folding_of(camera)


def _folding_of(camera: CameraModel) -> str | None:
    """Return a description if the radial distortion folds the image before its farthest corner."""
    k1, k2, _, _, k3 = camera.distortion
    u = np.array([0.0, camera.width - 1.0, 0.0, camera.width - 1.0])
    v = np.array([0.0, 0.0, camera.height - 1.0, camera.height - 1.0])
    reach = float(np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy).max())
    # Undistorted radii up to twice the visible one: barrel distortion of 50 % is a fisheye.
    r = np.linspace(0.0, 2.0 * reach, 2001)
    distorted = r * (1.0 + r**2 * (k1 + r**2 * (k2 + r**2 * k3)))
    rising = np.cumprod(np.diff(distorted) > 0.0).astype(bool)
    if float(distorted[1:][rising].max(initial=0.0)) < reach:
        return f"The distortion (k1 {k1:.3g}, k2 {k2:.3g}) folds the image onto itself"
    return None


def _common_size(images: Sequence[LinearImage]) -> tuple[int, int]:
    if len(images) < MIN_VIEWS:
        text = f"There are {len(images)} images, but at least {MIN_VIEWS} are needed"
        raise InputError(text, "checkerboard", more_views_advice())
    size = images[0].size
    for image in images:
        require_size(image.size, size, where=f"checkerboard/{image.name}")
    return size


def _solve_without_outliers(
    views: list[LensView], size: tuple[int, int]
) -> tuple[list[LensView], LensFit]:
    """Solve, and repeat without the worst view as long as one is an outlier."""
    while True:
        require_views(views)
        index = [i for i, view in enumerate(views) if view.used]
        boards = [view.board for view in views if view.used and view.board is not None]
        fit = solve_from_scratch(boards, size)
        worst = int(np.argmax(fit.view_rms_px))
        typical = float(np.median(fit.view_rms_px))
        if fit.view_rms_px[worst] <= max(OUTLIER_RATIO * typical, OUTLIER_LEAST_PX):
            return views, fit
        rms = fit.view_rms_px[worst]
        reason = f"The corners deviate by {rms:.2f} px, those of a typical view by {typical:.2f} px"
        views = list(views)
        views[index[worst]] = replace(views[index[worst]], used=False, reason=reason)


def _describe_views(
    views: Sequence[LensView], fit: LensFit, camera: CameraModel
) -> tuple[LensView, ...]:
    described = []
    solved = iter(range(len(fit.rotations)))
    for view in views:
        if view.used and view.board is not None:
            k = next(solved)
            points = view.board.board.points_mm @ fit.rotations[k].T + fit.shifts_mm[k]
            view = replace(
                view,
                residuals_px=camera.project(points) - view.board.corners_px,
                rms_px=float(fit.view_rms_px[k]),
            )
        described.append(view)
    return tuple(described)
