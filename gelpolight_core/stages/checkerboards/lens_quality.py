"""Quality of a lens calibration: observability, coverage, and judged figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, judge, judge_excluded_images
from gelpolight_core.geometry.camera import CameraModel

from .checkerboard import BoardView
from .lens_fit import LensFit
from .lens_views import MIN_VIEWS, LensView, more_views_advice

# Below this, perspective differs between views by less than the errors of a printed board.
MIN_NORMAL_SPREAD_DEG = 5.0
# A focal length error of 1 % makes every length of the sensor wrong by 1 %.
MAX_FOCAL_SD = 0.01


def refuse_unobservable(sd: Float64Array, fit: LensFit, spread_deg: float) -> None:
    """Refuse views from which the focal length cannot be determined.

    There are two causes: nearly parallel boards, and a board that is not the flat grid that was
    stated.

    Parameters
    ----------
    sd : (9,)
        Standard deviations of the intrinsics.
    fit : LensFit
        The solution.
    spread_deg : float
        Variation of the board tilt.

    Raises
    ------
    InputError
        If the boards are nearly parallel or the focal length is uncertain by more than 1 %.
    """
    focal_sd = float(np.max(sd[:2] / np.abs(fit.values[:2])))
    if spread_deg >= MIN_NORMAL_SPREAD_DEG and focal_sd <= MAX_FOCAL_SD:
        return
    if spread_deg < MIN_NORMAL_SPREAD_DEG:
        text = (
            f"The views are nearly parallel: the board tilt varies by only {spread_deg:.1f} "
            f"degrees, so the focal length is uncertain by {100.0 * focal_sd:.2g} %"
        )
        raise InputError(text, "checkerboard", more_views_advice())
    text = (
        f"The corners do not lie on the stated flat grid (error {fit.rms_px:.2f} px), so the "
        f"focal length is uncertain by {100.0 * focal_sd:.2g} % although the board tilt varies "
        f"by {spread_deg:.1f} degrees"
    )
    raise InputError(text, "checkerboard", Remedy.FLAT_BOARD)


def coverage_counts(views: Sequence[BoardView], size: tuple[int, int]) -> NDArray[np.int64]:
    """Count the corners in each part of the image.

    Parameters
    ----------
    views : sequence of BoardView
        The used views.
    size : (width, height)
        Size of the images.

    Returns
    -------
    (6, 8) int
        Row by row from the top left.
    """
    corners = np.concatenate([view.corners_px for view in views]) + 0.5
    counts, _, _ = np.histogram2d(
        corners[:, 1], corners[:, 0], bins=(6, 8), range=[(0, size[1]), (0, size[0])]
    )
    return counts.astype(np.int64)


def fit_figures(
    fit: LensFit, held_out_rms: float, sd: Float64Array, camera: CameraModel
) -> tuple[Finding, ...]:
    """Judge the misfit of the corners and the uncertainty of the camera.

    Parameters
    ----------
    fit : LensFit
        The solution.
    held_out_rms : float
        Reprojection error of held-out views, pixels.
    sd : (9,)
        Standard deviations of the intrinsics.
    camera : CameraModel
        The intrinsics.
    """
    focal = max(100.0 * sd[0] / camera.fx, 100.0 * sd[1] / camera.fy)
    centre = float(np.hypot(sd[2], sd[3]))
    steady = "Use a flat board, hold it still, and focus; check the views with large errors"
    views = more_views_advice()
    centre_text = "Uncertainty of the principal point"
    focal_text = "Uncertainty of the focal length"
    held_out_text, error_text = "Error on held-out views", "Reprojection error"
    return (
        # A good print is accurate to 0.1 px; half a pixel at the edge is 0.05 mm on the membrane.
        judge("reprojection_rms", error_text, fit.rms_px, "px", warn=0.3, fail=1.0, remedy=steady),
        judge("held_out_rms", held_out_text, held_out_rms, "px", warn=0.4, fail=1.5, remedy=views),
        judge(
            "focal_sd",
            focal_text,
            float(focal),
            "%",
            warn=0.1,
            fail=100.0 * MAX_FOCAL_SD,
            remedy=views,
        ),
        judge(
            "centre_sd",
            centre_text,
            centre,
            "px",
            warn=camera.width / 500.0,
            fail=camera.width / 50.0,
            remedy=views,
        ),
    )


def view_figures(
    views: Sequence[LensView], coverage: float, spread_deg: float
) -> tuple[Finding, ...]:
    """Judge the content of the views.

    Parameters
    ----------
    views : sequence of LensView
        Used or not.
    coverage : float
        Share of the parts of the image with a corner.
    spread_deg : float
        Variation of the board tilt.
    """
    used = sum(view.used for view in views)
    refused = [f"{view.name} ({view.reason})" for view in views if not view.used]
    edges = [v.board.edge_width_px for v in views if v.used and v.board is not None]
    tilt, more_views = "Tilt the board more and in different directions", more_views_advice()
    corners = "Also show the board in the corners of the image"
    return (
        judge(
            "views_used",
            "Views used",
            used,
            warn=8,
            fail=MIN_VIEWS,
            higher_is_better=True,
            remedy=more_views,
        ),
        judge_excluded_images("views_left_out", "Views left out", refused),
        judge(
            "normal_spread",
            "Variation of the board tilt",
            spread_deg,
            "deg",
            warn=10.0,
            fail=MIN_NORMAL_SPREAD_DEG,
            higher_is_better=True,
            remedy=tilt,
        ),
        # Without corners, the distortion is a guess.
        judge(
            "coverage",
            "Image area covered by corners",
            100.0 * coverage,
            "%",
            warn=60.0,
            fail=25.0,
            higher_is_better=True,
            remedy=corners,
        ),
        judge("edge_width", "Edge width of the squares", float(np.median(edges)), "px"),
    )
