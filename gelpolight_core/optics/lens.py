"""Calibrate the lens from checkerboard views: intrinsics, how sure they are, and what was left out.

Zhang's method as OpenCV solves it (pinhole, k1 k2 p1 p2, k3 = 0), wrapped in the doubts that a
calibration needs: views are checked one by one, duplicates and outliers are left out by name, the
uncertainty is the larger of the formal one and of the jackknife over views, and every view is
also judged by a camera that was calibrated without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.checkerboard import BoardSpec, BoardView, find_board
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# Three views are the least that Zhang's method needs; the fourth checks them.
MIN_VIEWS = 4
# Below this the perspective of a 3 mm square differs between views by less than a print's faults.
MIN_NORMAL_SPREAD_DEG = 5.0
# A focal length known to 1 % makes every length of the sensor wrong by as much.
MAX_FOCAL_SD = 0.01
# Two pictures whose corners differ by less are one view taken twice.
DUPLICATE_PX = 0.5
# A view this much worse than the median view does not show what the others show.
OUTLIER_RATIO = 3.0
# ... if it is also worse than what a good print and a good fit come to.
OUTLIER_LEAST_PX = 0.1
COVERAGE_CELLS = (6, 8)
_JACKKNIFE_GROUPS = 12
_FLAGS = cv2.CALIB_FIX_K3


@dataclass(frozen=True, slots=True)
class LensView:
    """What became of one picture.

    Attributes
    ----------
    name : str
        The picture's name.
    used : bool
        Whether it took part in the calibration.
    reason : str
        Why not; empty when it did.
    advice : str
        What to do about it.
    board : BoardView or None
        The corners, where they were found.
    residuals_px : (N, 2) or None
        Projected minus seen corner, of the used views.
    rms_px, held_out_rms_px : float
        Of this view by the camera with it, and by a camera calibrated without it; NaN if unused.
    normal_camera : (3,) or None
        The board's normal, pointing away from the camera.
    distance_mm : float
        Of the board's plane; NaN if unused.
    """

    name: str
    used: bool
    reason: str
    advice: str = ""
    board: BoardView | None = None
    residuals_px: Array | None = None
    rms_px: float = math.nan
    held_out_rms_px: float = math.nan
    normal_camera: Array | None = None
    distance_mm: float = math.nan


@dataclass(frozen=True, slots=True)
class LensResult:
    """The calibrated lens.

    Attributes
    ----------
    camera : Camera
        The intrinsics.
    focal_sd_px : (fx, fy)
        Standard deviations; so are the next two.
    centre_sd_px : (cx, cy)
    distortion_sd : (k1, k2, p1, p2, k3)
    square_pixels : bool
        Whether fx = fy was kept, as nothing in the views speaks against it.
    views : tuple of LensView
        All pictures, used or not, in the given order.
    rms_px : float
        Over all corners of all used views, both coordinates together.
    held_out_rms_px : float
        The same for corners of views that the camera was calibrated without.
    coverage_map : (6, 8) int
        Corners seen in each part of the picture.
    coverage : float
        Share of those parts that hold a corner.
    normal_spread_deg : float
        RMS angle of the boards' normals about their mean: without it, no focal length.
    quality : QualityTable
        The judged figures.
    """

    camera: Camera
    focal_sd_px: tuple[float, float]
    centre_sd_px: tuple[float, float]
    distortion_sd: tuple[float, float, float, float, float]
    square_pixels: bool
    views: tuple[LensView, ...]
    rms_px: float
    held_out_rms_px: float
    coverage_map: NDArray[np.int64]
    coverage: float
    normal_spread_deg: float
    quality: QualityTable


@dataclass(frozen=True, slots=True)
class _Fit:
    """One solution: values are fx, fy, cx, cy, k1, k2, p1, p2, k3."""

    values: Array
    sd: Array
    rotations: tuple[Array, ...]
    shifts_mm: tuple[Array, ...]
    view_rms_px: Array
    rms_px: float

    @property
    def matrix(self) -> Array:
        fx, fy, cx, cy = self.values[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class _HeldOut:
    """Cameras (G, 9) that were calibrated without a group of views; rms (V,) of those views."""

    values: Array
    view_rms_px: Array

    @property
    def sd(self) -> Array:
        """Jackknife standard deviation of each value."""
        groups = len(self.values)
        return np.asarray(np.sqrt((groups - 1.0) * np.var(self.values, axis=0)))


def calibrate_lens(pictures: Sequence[Picture], board: BoardSpec) -> LensResult:
    """Calibrate the lens from views of one checkerboard at different tilts.

    Parameters
    ----------
    pictures : sequence of Picture
        At least 4 usable; 10 to 20, tilted by 15 to 40 degrees, all over the picture, are good.
    board : BoardSpec
        The board in all of them.

    Returns
    -------
    LensResult
        Camera, uncertainty, and what was used. A blurred, failing, double or outlying view among
        good ones is left out and named.

    Raises
    ------
    InputError
        If pictures differ in size, fewer than 4 views are left, the views are too nearly
        parallel to give a focal length, or the intrinsics cannot be those of a camera.
    """
    size = _common_size(pictures)
    views = _leave_out_duplicates([_look(picture, board) for picture in pictures])
    _require_views(views)
    views, fit = _solve_without_outliers(views, size)
    used = [view for view in views if view.used]
    seen = [view.board for view in used if view.board is not None]
    held_out = _hold_out(seen, size, fit, square_pixels=False)
    shared = _solve(seen, size, start=fit, square_pixels=True)
    square_pixels = shared is not None and not _aspect_is_significant(fit, shared, held_out, seen)
    if square_pixels and shared is not None:
        fit = shared
        held_out = _hold_out(seen, size, fit, square_pixels=True)
    camera = _camera(fit.values, size)
    spread_deg = _normal_spread_deg(fit)
    sd = np.maximum(fit.sd, held_out.sd)
    _refuse_unobservable(sd, fit, spread_deg)
    _refuse_nonsense(camera)
    return _assemble(views, fit, held_out, camera, sd, spread_deg, square_pixels)


def find_nonsense(camera: Camera) -> str | None:
    """Say what is impossible about a camera's intrinsics; None when nothing is.

    Parameters
    ----------
    camera : Camera
        Of this or another program's making.
    """
    values = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
    if not np.isfinite(values).all():
        return tr("the intrinsics hold values that are not numbers")
    longest = max(camera.width, camera.height)
    # From a fisheye's 150 degrees, which no pinhole model holds, to 3 degrees across.
    if not 0.13 * longest < min(camera.fx, camera.fy) <= max(camera.fx, camera.fy) < 20.0 * longest:
        return tr("focal lengths of {fx:.0f} and {fy:.0f} px do not suit {n} px").format(
            fx=camera.fx, fy=camera.fy, n=longest
        )
    if abs(camera.fx / camera.fy - 1.0) > 0.1:
        return tr("fx {fx:.0f} and fy {fy:.0f} px differ by more than 10 %: no pixel is so").format(
            fx=camera.fx, fy=camera.fy
        )
    if not (0.0 < camera.cx < camera.width and 0.0 < camera.cy < camera.height):
        return tr("the principal point ({x:.0f}, {y:.0f}) lies outside of the picture").format(
            x=camera.cx, y=camera.cy
        )
    return _folding_of(camera)


def _folding_of(camera: Camera) -> str | None:
    """Say where the radial distortion folds the picture over itself before its farthest corner."""
    k1, k2, _, _, k3 = camera.distortion
    u = np.array([0.0, camera.width - 1.0, 0.0, camera.width - 1.0])
    v = np.array([0.0, 0.0, camera.height - 1.0, camera.height - 1.0])
    reach = float(np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy).max())
    # Undistorted radii up to twice the seen one: barrel distortion of 50 % is a fisheye's.
    r = np.linspace(0.0, 2.0 * reach, 2001)
    seen = r * (1.0 + r**2 * (k1 + r**2 * (k2 + r**2 * k3)))
    rising = np.cumprod(np.diff(seen) > 0.0).astype(bool)
    if float(seen[1:][rising].max(initial=0.0)) < reach:
        return tr("the distortion (k1 {a:.3g}, k2 {b:.3g}) folds the picture over itself").format(
            a=k1, b=k2
        )
    return None


def _common_size(pictures: Sequence[Picture]) -> tuple[int, int]:
    if len(pictures) < MIN_VIEWS:
        raise InputError(
            tr("there are {n} pictures, at least {m} are needed").format(
                n=len(pictures), m=MIN_VIEWS
            ),
            where=tr("checkerboard"),
            advice=_more_views(),
        )
    size = pictures[0].size
    for picture in pictures:
        if picture.size != size:
            raise InputError(
                tr("the picture is {a} x {b} pixels, {name} is {c} x {d}").format(
                    a=picture.size[0],
                    b=picture.size[1],
                    name=pictures[0].name,
                    c=size[0],
                    d=size[1],
                ),
                where=picture.name,
                advice=tr("Capture all pictures of a session at one size"),
            )
    return size


def _more_views() -> str:
    return tr("Capture 10 or more sharp views of the board, tilted by 15 to 40 degrees either way")


def _look(picture: Picture, board: BoardSpec) -> LensView:
    try:
        return LensView(picture.name, True, "", board=find_board(picture, board))
    except InputError as refusal:
        return LensView(picture.name, False, refusal.found, refusal.advice)


def _leave_out_duplicates(views: list[LensView]) -> list[LensView]:
    kept: list[LensView] = []
    for view in views:
        twin = next((other for other in kept if _same_pose(view, other)), None)
        if twin is not None:
            reason = tr("shows the board just as {name} does").format(name=twin.name)
            view = replace(view, used=False, reason=reason)
        kept.append(view)
    return kept


def _same_pose(view: LensView, other: LensView) -> bool:
    if not (view.used and other.used) or view.board is None or other.board is None:
        return False
    apart = view.board.corners_px - other.board.corners_px
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))) < DUPLICATE_PX


def _require_views(views: Sequence[LensView]) -> None:
    used = sum(view.used for view in views)
    if used >= MIN_VIEWS:
        return
    refused: dict[str, list[LensView]] = {}
    for view in views:
        if not view.used:
            refused.setdefault(view.reason, []).append(view)
    groups = sorted(refused.values(), key=len, reverse=True)
    raise InputError(
        tr("{n} of {m} views can be used, at least {k} are needed ({why})").format(
            n=used,
            m=len(views),
            k=MIN_VIEWS,
            why="; ".join(f"{_names(group)}: {group[0].reason}" for group in groups),
        ),
        where=tr("checkerboard"),
        advice=groups[0][0].advice or _more_views(),
    )


def _names(views: Sequence[LensView]) -> str:
    if len(views) <= 4:
        return ", ".join(view.name for view in views)
    return tr("{first} and {n} others").format(first=views[0].name, n=len(views) - 1)


def _solve_without_outliers(
    views: list[LensView], size: tuple[int, int]
) -> tuple[list[LensView], _Fit]:
    """Solve, and solve again without the worst view for as long as one stands out."""
    while True:
        _require_views(views)
        index = [i for i, view in enumerate(views) if view.used]
        seen = [view.board for view in views if view.used and view.board is not None]
        fit = _solve_from_scratch(seen, size)
        worst = int(np.argmax(fit.view_rms_px))
        typical = float(np.median(fit.view_rms_px))
        if fit.view_rms_px[worst] <= max(OUTLIER_RATIO * typical, OUTLIER_LEAST_PX):
            return views, fit
        reason = tr("its corners are off by {a:.2f} px, those of a typical view by {b:.2f} px")
        views = list(views)
        views[index[worst]] = replace(
            views[index[worst]],
            used=False,
            reason=reason.format(a=fit.view_rms_px[worst], b=typical),
        )


def _solve_from_scratch(seen: Sequence[BoardView], size: tuple[int, int]) -> _Fit:
    """Solve from Zhang's closed form and from a plain guess; the better of the two."""
    guess = _guess(size)
    fits = [_solve(seen, size, start=start, square_pixels=False) for start in (None, guess)]
    solved = [fit for fit in fits if fit is not None and np.isfinite(fit.values).all()]
    if not solved:
        raise InputError(
            tr("no camera explains the views"),
            where=tr("checkerboard"),
            advice=_more_views(),
        )
    return min(solved, key=lambda fit: fit.rms_px)


def _guess(size: tuple[int, int]) -> _Fit:
    """Return a camera that sees as far across as it is away, axis through the middle."""
    centre = [(size[0] - 1) / 2.0, (size[1] - 1) / 2.0]
    values = np.array([float(max(size)), float(max(size)), *centre, 0.0, 0.0, 0.0, 0.0, 0.0])
    return _Fit(values, np.zeros(9), (), (), np.zeros(0), math.inf)


def _solve(
    seen: Sequence[BoardView], size: tuple[int, int], *, start: _Fit | None, square_pixels: bool
) -> _Fit | None:
    """Solve all views at once; None where OpenCV finds the views degenerate."""
    flags = _FLAGS
    matrix, distortion = np.eye(3), np.zeros(5)
    if start is not None:
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS
        matrix, distortion = start.matrix, start.values[4:].copy()
    if square_pixels:
        # OpenCV keeps the ratio that the guess has.
        matrix[0, 0] = matrix[1, 1] = 0.5 * (matrix[0, 0] + matrix[1, 1])
        flags |= cv2.CALIB_FIX_ASPECT_RATIO
    try:
        rms, solved, bent, turns, shifts, sd, _, view_rms = cv2.calibrateCameraExtended(
            [view.board.points_mm.astype(np.float32) for view in seen],
            [view.corners_px.astype(np.float32) for view in seen],
            size,
            matrix,
            distortion,
            flags=flags,
        )
    except cv2.error:
        return None
    values = np.array([solved[0, 0], solved[1, 1], solved[0, 2], solved[1, 2], *bent.ravel()[:5]])
    sds = np.asarray(sd, dtype=np.float64).ravel()[:9].copy()
    if square_pixels:
        sds[:2] = sds[:2].max()
    return _Fit(
        values,
        sds,
        tuple(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64) for turn in turns),
        tuple(np.asarray(shift, dtype=np.float64).ravel() for shift in shifts),
        np.asarray(view_rms, dtype=np.float64).ravel(),
        float(rms),
    )


def _hold_out(
    seen: Sequence[BoardView], size: tuple[int, int], fit: _Fit, *, square_pixels: bool
) -> _HeldOut:
    """Calibrate without each group of views, and see how the camera explains those."""
    groups = min(len(seen), _JACKKNIFE_GROUPS)
    group_of = np.arange(len(seen)) % groups
    values = []
    view_rms = np.full(len(seen), np.nan)
    for group in range(groups):
        rest = [view for view, g in zip(seen, group_of, strict=True) if g != group]
        other = _solve(rest, size, start=fit, square_pixels=square_pixels)
        if other is None:
            continue
        values.append(other.values)
        for index in map(int, np.flatnonzero(group_of == group)):
            view_rms[index] = _rms_of_pose(seen[index], other)
    return _HeldOut(np.array(values).reshape(-1, 9), view_rms)


def _rms_of_pose(view: BoardView, fit: _Fit) -> float:
    points, distortion = view.board.points_mm, fit.values[4:]
    _, turn, shift = cv2.solvePnP(points, view.corners_px, fit.matrix, distortion)
    turn, shift = cv2.solvePnPRefineLM(points, view.corners_px, fit.matrix, distortion, turn, shift)
    seen, _ = cv2.projectPoints(points, turn, shift, fit.matrix, distortion)
    apart = np.asarray(seen, dtype=np.float64).reshape(-1, 2) - view.corners_px
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _aspect_is_significant(
    free: _Fit, shared: _Fit, held_out: _HeldOut, seen: Sequence[BoardView]
) -> bool:
    """Whether fx and fy differ by three standard deviations, formally and over the views.

    Cameras have square pixels; only evidence beyond the noise of the corners and beyond the
    scatter of the views speaks for others.
    """
    corners = sum(len(view.corners_px) for view in seen)
    freedom = max(2 * corners - 8 - 6 * len(seen), 1)
    gain = freedom * (shared.rms_px**2 / max(free.rms_px**2, 1e-30) - 1.0)
    ratios = held_out.values[:, 0] / held_out.values[:, 1]
    scatter = math.sqrt((len(ratios) - 1.0) * float(np.var(ratios)))
    return gain > 9.0 and abs(free.values[0] / free.values[1] - 1.0) > 3.0 * scatter


def _camera(values: Array, size: tuple[int, int]) -> Camera:
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(v) for v in values)
    return Camera(size[0], size[1], fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def _normal(rotation: Array) -> Array:
    normal = rotation[:, 2]
    return np.asarray(normal if normal[2] > 0.0 else -normal)


def _normal_spread_deg(fit: _Fit) -> float:
    normals = np.stack([_normal(rotation) for rotation in fit.rotations])
    mean = normals.mean(axis=0)
    mean /= np.linalg.norm(mean)
    angles = np.arccos(np.clip(normals @ mean, -1.0, 1.0))
    return math.degrees(float(np.sqrt(np.mean(angles**2))))


def _refuse_unobservable(sd: Array, fit: _Fit, spread_deg: float) -> None:
    focal_sd = float(np.max(sd[:2] / np.abs(fit.values[:2])))
    if spread_deg >= MIN_NORMAL_SPREAD_DEG and focal_sd <= MAX_FOCAL_SD:
        return
    raise InputError(
        tr(
            "the views are too nearly parallel: the board's tilt varies by {s:.1f} degrees, "
            "and the focal length is known to {p:.2g} % only"
        ).format(s=spread_deg, p=100.0 * focal_sd),
        where=tr("checkerboard"),
        advice=_more_views(),
    )


def _refuse_nonsense(camera: Camera) -> None:
    nonsense = find_nonsense(camera)
    if nonsense is not None:
        raise InputError(nonsense, where=tr("checkerboard"), advice=_more_views())


def _assemble(
    views: Sequence[LensView],
    fit: _Fit,
    held_out: _HeldOut,
    camera: Camera,
    sd: Array,
    spread_deg: float,
    square_pixels: bool,
) -> LensResult:
    described = _describe_views(views, fit, held_out, camera)
    used = [view.board for view in described if view.used and view.board is not None]
    coverage_map = _coverage(used, (camera.width, camera.height))
    coverage = float(np.mean(coverage_map > 0))
    held_out_rms = float(np.sqrt(np.mean(held_out.view_rms_px**2)))
    figures = (
        *_fit_figures(fit, held_out_rms, sd, camera),
        *_view_figures(described, coverage, spread_deg),
    )
    return LensResult(
        camera=camera,
        focal_sd_px=(float(sd[0]), float(sd[1])),
        centre_sd_px=(float(sd[2]), float(sd[3])),
        distortion_sd=(float(sd[4]), float(sd[5]), float(sd[6]), float(sd[7]), float(sd[8])),
        square_pixels=square_pixels,
        views=described,
        rms_px=fit.rms_px,
        held_out_rms_px=held_out_rms,
        coverage_map=coverage_map,
        coverage=coverage,
        normal_spread_deg=spread_deg,
        quality=QualityTable(figures),
    )


def _describe_views(
    views: Sequence[LensView], fit: _Fit, held_out: _HeldOut, camera: Camera
) -> tuple[LensView, ...]:
    described = []
    solved = iter(range(len(fit.rotations)))
    for view in views:
        if view.used and view.board is not None:
            k = next(solved)
            points = view.board.board.points_mm @ fit.rotations[k].T + fit.shifts_mm[k]
            normal = _normal(fit.rotations[k])
            view = replace(
                view,
                residuals_px=camera.project(points) - view.board.corners_px,
                rms_px=float(fit.view_rms_px[k]),
                held_out_rms_px=float(held_out.view_rms_px[k]),
                normal_camera=normal,
                distance_mm=float(normal @ fit.shifts_mm[k]),
            )
        described.append(view)
    return tuple(described)


def _coverage(seen: Sequence[BoardView], size: tuple[int, int]) -> NDArray[np.int64]:
    corners = np.concatenate([view.corners_px for view in seen]) + 0.5
    counts, _, _ = np.histogram2d(
        corners[:, 1], corners[:, 0], bins=COVERAGE_CELLS, range=[(0, size[1]), (0, size[0])]
    )
    return counts.astype(np.int64)


def _fit_figures(fit: _Fit, held_out_rms: float, sd: Array, camera: Camera) -> tuple[Figure, ...]:
    focal = max(100.0 * sd[0] / camera.fx, 100.0 * sd[1] / camera.fy)
    centre = float(np.hypot(sd[2], sd[3]))
    steady = tr("Use a flat board, hold it still, and focus; look at the views with large errors")
    return (
        # A good print is placed to 0.1 px; half a pixel at the rim is 0.05 mm on the membrane.
        judge("reprojection_rms", tr("Reprojection error"), fit.rms_px, "px",
              warn=0.3, fail=1.0, advice=steady),
        judge("held_out_rms", tr("Error on views held out"), held_out_rms, "px",
              warn=0.4, fail=1.5, advice=_more_views()),
        judge("focal_sd", tr("Uncertainty of the focal length"), float(focal), "%",
              warn=0.1, fail=100.0 * MAX_FOCAL_SD, advice=_more_views()),
        judge("centre_sd", tr("Uncertainty of the principal point"), centre, "px",
              warn=camera.width / 500.0, fail=camera.width / 50.0, advice=_more_views()),
    )  # fmt: skip


def _view_figures(
    views: Sequence[LensView], coverage: float, spread_deg: float
) -> tuple[Figure, ...]:
    used = sum(view.used for view in views)
    refused = [f"{view.name} ({view.reason})" for view in views if not view.used]
    edges = [v.board.edge_width_px for v in views if v.used and v.board is not None]
    return (
        judge("views_used", tr("Views used"), used,
              warn=8, fail=MIN_VIEWS, higher_is_better=True, advice=_more_views()),
        judge("views_left_out", tr("Views left out"), len(refused), warn=0,
              advice=tr("Left out: {names}").format(names="; ".join(refused))),
        judge("normal_spread", tr("Variation of the board's tilt"), spread_deg, "deg",
              warn=10.0, fail=MIN_NORMAL_SPREAD_DEG, higher_is_better=True,
              advice=tr("Tilt the board more, in other directions")),
        # Where no corner was seen, the distortion is a guess.
        judge("coverage", tr("Picture covered by corners"), 100.0 * coverage, "%",
              warn=60.0, fail=25.0, higher_is_better=True,
              advice=tr("Show the board in the corners of the picture too")),
        judge("edge_width", tr("Width of the squares' edges"), float(np.median(edges)), "px"),
    )  # fmt: skip
