"""Find a checkerboard in a picture, place its corners to a few hundredths of a pixel, and doubt it.

OpenCV's detectors say where a board may be; nothing they say is taken on trust. Every corner is
placed by fitting the picture of two crossing edges, and a board counts as found only when the
corners alternate in sign like a checkerboard's, lie on a perspective grid, and the pattern ends
where the session says that it ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import erf

from gelpolight_core.errors import InputError
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# Ten steps of an 8-bit picture: below it rounding alone moves an edge by 1/20 pixel.
MIN_CONTRAST = 10.0 / 255.0
# A value that the camera may have cut off.
SATURATED = 254.5 / 255.0
# Half of the light squares cut off leaves their edges without a level to be measured from.
MAX_SATURATED_SHARE = 0.5
# An edge over more than 1/200 of the picture's width resolves fewer than 100 line pairs across
# it, too few for a depth map; over a third of a square it runs into the next edge.
MAX_EDGE_OF_WIDTH = 1.0 / 200.0
# Three pixels are sharp to any fit, however small the picture.
MAX_EDGE_AT_LEAST_PX = 3.0
MAX_EDGE_OF_SQUARE = 1.0 / 3.0
# A printed board keeps its lines to about 0.5 % of a square; a misplaced corner is off by 50 %.
MAX_RMS_OF_SQUARE = 0.02
MAX_OFF_OF_SQUARE = 0.08
# A real crossing has its neighbours' amplitude (1); the end of a lone edge square has half of it.
MIN_CROSSING = 0.75
# One square is even (0); half light and half dark has half the contrast.
MAX_SPREAD_IN_SQUARE = 0.25
# 10 % to 90 % of an edge blurred by a Gaussian of sd 1.
_EDGE_OF_SIGMA = 2.563
# A square pixel averages over itself: no edge is sharper than the sd of a unit box.
_SIGMA_OF_PIXEL = 1.0 / math.sqrt(12.0)


@dataclass(frozen=True, slots=True)
class BoardSpec:
    """The printed checkerboard.

    Attributes
    ----------
    inner_corners : (columns, rows)
        Where four squares meet; one less than squares either way.
    square_mm : float
        Side of a square.
    """

    inner_corners: tuple[int, int] = (9, 6)
    square_mm: float = 3.0

    def __post_init__(self) -> None:
        """Refuse a board that cannot be.

        Raises
        ------
        InputError
            If there are fewer than 3 corners either way or the squares have no size.
        """
        if min(self.inner_corners) < 3:
            raise InputError(
                tr("the board has {w} x {h} inner corners").format(
                    w=self.inner_corners[0], h=self.inner_corners[1]
                ),
                where=tr("checkerboard"),
                advice=tr("State at least 3 x 3: the points where four squares meet"),
            )
        if not (math.isfinite(self.square_mm) and self.square_mm > 0.0):
            raise InputError(
                tr("the squares' side is {s} mm").format(s=self.square_mm),
                where=tr("checkerboard"),
                advice=tr("Measure the side of a square and state it in mm"),
            )

    @property
    def points_mm(self) -> Array:
        """(N, 3) the corners on the board, row by row; z is 0."""
        columns, rows = self.inner_corners
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        return flat * np.float64(self.square_mm)


@dataclass(frozen=True, slots=True)
class BoardView:
    """A checkerboard found in one picture.

    Attributes
    ----------
    name : str
        The picture's name.
    board : BoardSpec
        The board.
    picture_size : (width, height)
        Of the picture, in pixels.
    corners_px : (N, 2)
        (u, v) of the inner corners, row by row, in the order of ``board.points_mm``; seen in
        the picture, rows follow columns clockwise, as on the board's printed side.
    homography_rms_px, homography_max_px : float
        How far the corners lie from a straight-line perspective grid; lens distortion shows here.
    grid_rms_px, grid_max_px : float
        The same after two radial distortion coefficients: what is left is not the lens.
    square_px : float
        Median side of a square.
    edge_width_px : float
        Sharpness: 10 % to 90 % width of the squares' edges, median of the corners.
    contrast : float
        Light squares minus dark squares, 0..1.
    saturated_share : float
        Share of the light squares' area that is at the end of the scale.
    bounding_box_px : (u_min, v_min, u_max, v_max)
        Around the corners: the part of the picture that this view covers.
    tilt_deg : float
        Tilt against the viewing direction, from the foreshortening (no camera needed).
    """

    name: str
    board: BoardSpec
    picture_size: tuple[int, int]
    corners_px: Array
    homography_rms_px: float
    homography_max_px: float
    grid_rms_px: float
    grid_max_px: float
    square_px: float
    edge_width_px: float
    contrast: float
    saturated_share: float
    bounding_box_px: tuple[float, float, float, float]
    tilt_deg: float


@dataclass(frozen=True, slots=True)
class _Window:
    """Pixels (N, P) around corners, their offsets x and y (P), and their weights (N, P)."""

    values: Array
    x: Array
    y: Array
    weights: Array


@dataclass(frozen=True, slots=True)
class _Crossings:
    """Fitted crossings of edges on a grid: (rows, columns, ...) arrays."""

    corners_px: Array
    amplitude: Array  # half of light minus dark, signed by the quadrant that is light
    sigma_px: Array


def find_board(picture: Picture, board: BoardSpec) -> BoardView:
    """Find the inner corners of a checkerboard, and make sure that it is the stated one.

    Parameters
    ----------
    picture : Picture
        Any size; colours are averaged.
    board : BoardSpec
        The board that should be there.

    Returns
    -------
    BoardView
        The corners and how good they are.

    Raises
    ------
    InputError
        If the picture is black, even, saturated or blurred, shows no board, or shows a board
        with another number of squares.
    """
    grey = _average_of_channels(picture)
    _check_exposure(grey, picture.name)
    rough = _detect_quickly(grey, board.inner_corners)
    if rough is None:
        _refuse_other_size(grey, board, picture.name)
        rough = _search(grey, board.inner_corners)
    if rough is None:
        raise _absent(grey, board, picture.name)
    grid = _fit_grid(grey, rough)
    if not _is_checkered(grey, grid):
        _refuse_other_size(grey, board, picture.name)
        raise _absent(grey, board, picture.name)
    if _goes_on(grey, grid):
        _refuse_other_size(grey, board, picture.name)
        raise _larger(board, picture.name)
    view = _describe(picture, grey, board, grid)
    _check_view(view)
    return view


def _average_of_channels(picture: Picture) -> NDArray[np.float32]:
    red, green, blue = (picture.rgb[..., k] for k in range(3))
    return np.asarray((red + green + blue) / np.float32(3.0), dtype=np.float32)


def _check_exposure(grey: NDArray[np.float32], name: str) -> None:
    finite = np.isfinite(grey)
    if not finite.all():
        raise InputError(
            tr("{n} pixels hold no number").format(n=int(np.count_nonzero(~finite))),
            where=name,
            advice=tr("Capture the picture again"),
        )
    # One pixel in 200 of each end may be a glint or a hole.
    low, high = np.percentile(grey[::2, ::2], [0.5, 99.5])
    if high - low >= MIN_CONTRAST:
        return
    if low >= SATURATED - MIN_CONTRAST:
        found, advice = tr("the picture is saturated"), tr("Shorten the exposure")
    elif high < 3.0 * MIN_CONTRAST:
        found, advice = tr("the picture is black"), tr("Light the board, or lengthen the exposure")
    else:
        found, advice = (
            tr("the picture is all of one brightness"),
            tr("Show the board to the camera"),
        )
    raise InputError(found, where=name, advice=advice)


def _detect_quickly(grey: NDArray[np.float32], size: tuple[int, int]) -> Array | None:
    """Ask OpenCV's contour detector for rough corners (rows, columns, 2): a few milliseconds."""
    small, scale = _for_detector(grey, longest_px=640)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    ok, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not ok:
        return None
    return _in_full_size(np.asarray(corners).reshape(size[1], size[0], 2), scale)


def _search(grey: NDArray[np.float32], size: tuple[int, int]) -> Array | None:
    """Ask OpenCV's slow detector, which copes with more noise and blur and with uneven light."""
    small, scale = _for_detector(grey)
    for flags in (cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE, 0):
        ok, corners = cv2.findChessboardCornersSB(small, size, flags=flags)
        if ok:
            return _in_full_size(np.asarray(corners).reshape(size[1], size[0], 2), scale)
    return None


def _detect_any_size(grey: NDArray[np.float32]) -> Array | None:
    """Ask OpenCV for the rough corners (rows, columns, 2) of whatever board there is."""
    small, scale = _for_detector(grey)
    for search in (0, cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE):
        ok, corners, marks = cv2.findChessboardCornersSBWithMeta(
            small, (3, 3), search | cv2.CALIB_CB_LARGER
        )
        if ok:
            rows, columns = np.asarray(marks).shape[:2]
            return _in_full_size(np.asarray(corners).reshape(rows, columns, 2), scale)
    return None


def _for_detector(
    grey: NDArray[np.float32], *, longest_px: int = 1300
) -> tuple[NDArray[np.uint8], Array]:
    """Return an 8-bit copy of at most `longest_px` (more only costs time), and its scale."""
    low, high = np.percentile(grey[::4, ::4], [0.5, 99.5])
    stretched = np.clip((grey - low) * (255.0 / max(high - low, 1e-6)), 0.0, 255.0)
    shrink = max(1.0, max(grey.shape) / longest_px)
    width, height = (round(n / shrink) for n in (grey.shape[1], grey.shape[0]))
    small = cv2.resize(stretched, (width, height), interpolation=cv2.INTER_AREA)
    scale = np.array([grey.shape[1] / width, grey.shape[0] / height])
    return np.asarray(small, dtype=np.uint8), scale


def _in_full_size(corners: NDArray[Any], scale: Array) -> Array:
    """Undo the shrinking, and let rows follow columns clockwise, as on a board's printed side."""
    full = (corners.astype(np.float64) + 0.5) * scale - 0.5
    along = full[0, -1] - full[0, 0]
    down = full[-1, 0] - full[0, 0]
    left_handed = along[0] * down[1] - along[1] * down[0] < 0.0
    return np.ascontiguousarray(full[:, ::-1]) if left_handed else full


def _fit_grid(grey: NDArray[np.float32], rough: Array) -> _Crossings:
    """Fit the crossings of a grid of rough corners (rows, columns, 2)."""
    rows, columns = rough.shape[:2]
    along, down = (np.gradient(rough, axis=axis).reshape(-1, 2) for axis in (1, 0))
    corners, amplitude, sigma = _fit_crossings(grey, rough.reshape(-1, 2), along, down)
    return _Crossings(
        corners.reshape(rows, columns, 2),
        amplitude.reshape(rows, columns),
        sigma.reshape(rows, columns),
    )


def _fit_crossings(
    grey: NDArray[np.float32], rough: Array, along: Array, down: Array
) -> tuple[Array, Array, Array]:
    """Fit two crossing blurred edges to each corner.

    The model around corner c is b + g.x + A erf(n1.(x-c) / s) erf(n2.(x-c) / s), s = sqrt(2)
    sigma: an uneven background, two edges of free direction, one blur. Damped Gauss-Newton on
    the five shape values; the four linear ones are solved anew in each round; all corners at once.

    Parameters
    ----------
    grey : (height, width)
        The picture.
    rough : (N, 2)
        Where to start.
    along, down : (N, 2)
        Steps to the next corner in the row and in the column, which are the edges' directions.

    Returns
    -------
    corners_px : (N, 2)
    amplitude : (N,)
    sigma_px : (N,)
    """
    area = np.abs(along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0])
    longest = np.maximum(np.linalg.norm(along, axis=1), np.linalg.norm(down, axis=1))
    # Up to 1 % of the picture, where lens distortion still leaves an edge straight.
    radius = np.clip(0.7 * area / np.maximum(longest, 1e-9), 3.0, max(8.0, grey.shape[1] / 100.0))
    shape = np.empty((len(rough), 5))
    shape[:, :2] = rough
    shape[:, 2] = np.arctan2(along[:, 0], -along[:, 1])
    shape[:, 3] = np.arctan2(down[:, 0], -down[:, 1])
    shape[:, 4] = 1.2
    # First a small window and one blur for all, wide enough to be drawn in from a pixel away.
    shape, _ = _fit_shapes(grey, shape, np.minimum(radius, 6.0), free_blur=False)
    shape, amplitude = _fit_shapes(grey, shape, radius, free_blur=True)
    return shape[:, :2], amplitude, shape[:, 4]


def _fit_shapes(
    grey: NDArray[np.float32], shape: Array, radius: Array, *, free_blur: bool, rounds: int = 12
) -> tuple[Array, Array]:
    """Improve shapes (N, 5) in windows of the given radii until no centre moves; and amplitudes."""
    base = np.zeros_like(shape)
    base[:, :2] = np.round(shape[:, :2])
    window = _cut_windows(grey, base[:, :2], radius)
    # Bounds keep the first steps, far from the answer, from jumping to a neighbouring corner.
    bound = np.array([1.0, 1.0, 0.2, 0.2, 0.5 if free_blur else 0.0])
    trust = np.ones(len(shape))
    local = shape - base
    step, amplitude, misfit = _propose(local, window, bound)
    for _ in range(rounds):
        trial = local + trust[:, None] * step
        trial[:, 4] = np.clip(trial[:, 4], _SIGMA_OF_PIXEL, radius)
        moved_px = np.abs(trial - local)[:, :2].max()
        new = _propose(trial, window, bound)
        better = new[2] <= misfit
        trust = np.where(better, np.minimum(1.0, 2.0 * trust), 0.25 * trust)
        local = np.where(better[:, None], trial, local)
        step = np.where(better[:, None], new[0], step)
        amplitude = np.where(better, new[1], amplitude)
        misfit = np.where(better, new[2], misfit)
        if moved_px < (1e-3 if free_blur else 0.05):
            break
    return base + local, amplitude


def _cut_windows(grey: NDArray[np.float32], base: Array, radius: Array) -> _Window:
    reach = math.ceil(float(radius.max()))
    y, x = (a.ravel().astype(np.float64) for a in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    u = base[:, :1] + x
    v = base[:, 1:] + y
    inside = (u >= 0) & (v >= 0) & (u < grey.shape[1]) & (v < grey.shape[0])
    values = grey[np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)]
    weights = inside & (x * x + y * y <= radius[:, None] ** 2)
    return _Window(values.astype(np.float64), x, y, weights.astype(np.float64))


def _propose(shape: Array, window: _Window, bound: Array) -> tuple[Array, Array, Array]:
    """Return the Gauss-Newton steps (N, 5), the amplitudes (N,) and the misfits (N,)."""
    surface, slopes = _crossing_model(shape, window.x, window.y)
    ones = np.ones_like(surface)
    basis = np.stack([ones, ones * window.x, ones * window.y, surface], axis=-1)
    linear = _solve(basis, window.weights, window.values)
    rest = window.values - (basis @ linear[..., None])[..., 0]
    free = np.flatnonzero(bound)
    both = np.concatenate([slopes[..., free] * linear[:, None, 3:], basis], axis=-1)
    step = np.zeros_like(shape)
    step[:, free] = _solve(both, window.weights, rest)[:, : len(free)]
    return np.clip(step, -bound, bound), linear[:, 3], np.sum(window.weights * rest**2, axis=1)


def _crossing_model(shape: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Return erf * erf (N, P) and its slopes (N, P, 5) by centre x, y, both angles and blur."""
    cx, cy, angle_1, angle_2, sigma = (column[:, None] for column in shape.T)
    dx, dy = x - cx, y - cy
    cos_1, sin_1, cos_2, sin_2 = np.cos(angle_1), np.sin(angle_1), np.cos(angle_2), np.sin(angle_2)
    off_1, off_2 = cos_1 * dx + sin_1 * dy, cos_2 * dx + sin_2 * dy
    edge_1, edge_2 = erf(off_1 / (math.sqrt(2.0) * sigma)), erf(off_2 / (math.sqrt(2.0) * sigma))
    peak = math.sqrt(2.0 / math.pi) / sigma
    steep_1 = peak * np.exp(-0.5 * (off_1 / sigma) ** 2) * edge_2
    steep_2 = peak * np.exp(-0.5 * (off_2 / sigma) ** 2) * edge_1
    slopes = (
        -(steep_1 * cos_1 + steep_2 * cos_2),
        -(steep_1 * sin_1 + steep_2 * sin_2),
        steep_1 * (cos_1 * dy - sin_1 * dx),
        steep_2 * (cos_2 * dy - sin_2 * dx),
        -(steep_1 * off_1 + steep_2 * off_2) / sigma,
    )
    return edge_1 * edge_2, np.stack(slopes, axis=-1)


def _solve(basis: Array, weights: Array, values: Array) -> Array:
    """Weighted least squares of (N, P) values in a basis (N, P, K): (N, K)."""
    transposed = np.swapaxes(basis * weights[..., None], 1, 2)
    normal = transposed @ basis
    # The ridge is nothing beside a seen corner and keeps an unseen one from stopping the rest.
    scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    normal = normal + (1e-12 * scale + 1e-12) * np.eye(basis.shape[2])
    return np.asarray(np.linalg.solve(normal, transposed @ values[..., None])[..., 0])


def _is_checkered(grey: NDArray[np.float32], grid: _Crossings) -> bool:
    """Whether corners alternate in sign and the border rows are as strong as their neighbours."""
    rows, columns = grid.amplitude.shape
    signed = grid.amplitude * (1 - 2 * (np.add.outer(np.arange(rows), np.arange(columns)) % 2))
    signed = signed * np.sign(np.median(signed))
    if not (signed > 0.0).all():
        return False
    if _mixed_squares(grey, grid):
        return False
    sides = [(signed[0], signed[1]), (signed[-1], signed[-2])]
    sides += [(signed[:, 0], signed[:, 1]), (signed[:, -1], signed[:, -2])]
    return all(float(np.median(outer / inner)) > MIN_CROSSING for outer, inner in sides)


def _mixed_squares(grey: NDArray[np.float32], grid: _Crossings) -> bool:
    """Whether the grid's meshes hold light and dark: a detector that jumped over corners."""
    t = np.linspace(0.2, 0.8, 7)
    right, down = (a.reshape(-1, 1, 1, 1) for a in np.meshgrid(t, t))
    c = grid.corners_px
    upper = (1.0 - right) * c[:-1, :-1] + right * c[:-1, 1:]
    lower = (1.0 - right) * c[1:, :-1] + right * c[1:, 1:]
    points = np.round((1.0 - down) * upper + down * lower).astype(int)
    u, v = (np.clip(points[..., k], 0, grey.shape[1 - k] - 1) for k in (0, 1))
    spread = grey[v, u].std(axis=0) / (2.0 * np.abs(grid.amplitude[:-1, :-1]))
    return bool(np.median(spread) > MAX_SPREAD_IN_SQUARE)


def _goes_on(grey: NDArray[np.float32], grid: _Crossings) -> bool:
    """Whether the checkerboard has a further row or column on any side of the grid."""
    return any(
        _has_next_row(grey, np.rot90(grid.corners_px, turns), np.rot90(grid.amplitude, turns))
        for turns in range(4)
    )


def _has_next_row(grey: NDArray[np.float32], corners: Array, amplitude: Array) -> bool:
    rows, columns = corners.shape[:2]
    x, y = np.meshgrid(np.arange(columns, dtype=np.float64), np.arange(rows, dtype=np.float64))
    matrix, _ = cv2.findHomography(np.stack([x, y], -1).reshape(-1, 2), corners.reshape(-1, 2))
    bend = corners - _apply(matrix, x, y)
    # Distortion bends the grid slowly: the border's misfit goes on outwards.
    beyond = _apply(matrix, x[0], y[0] - 1.0) + 2.0 * bend[0] - bend[1]
    step = corners[0] - beyond
    # A quarter of a square around a corner has to be in the picture for it to be told.
    margin = 0.25 * np.linalg.norm(step, axis=1, keepdims=True)
    limit = np.array([grey.shape[1], grey.shape[0]]) - 1.0
    seen = ((beyond > margin) & (beyond < limit - margin)).all(axis=1)
    if np.count_nonzero(seen) < max(2.0, 0.5 * columns):
        return False
    along = np.gradient(beyond, axis=0)
    found, further, _ = _fit_crossings(grey, beyond[seen], along[seen], step[seen])
    moved = np.linalg.norm(found - beyond[seen], axis=1)
    real = (-further / amplitude[0][seen] > MIN_CROSSING) & (moved < margin[seen, 0])
    return bool(2 * np.count_nonzero(real) > len(real))


def _apply(matrix: NDArray[Any], x: Array, y: Array) -> Array:
    mapped = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.asarray(matrix, dtype=np.float64).T
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def _describe(
    picture: Picture, grey: NDArray[np.float32], board: BoardSpec, grid: _Crossings
) -> BoardView:
    corners = np.ascontiguousarray(grid.corners_px.reshape(-1, 2))
    flat = board.points_mm[:, :2]
    matrix, _ = cv2.findHomography(flat, corners)
    off = np.linalg.norm(_apply(matrix, flat[:, 0], flat[:, 1]) - corners, axis=1)
    rest = _grid_misfit(flat, corners, matrix, picture.size)
    steps = [np.linalg.norm(np.diff(grid.corners_px, axis=axis), axis=-1) for axis in (0, 1)]
    low, high = corners.min(axis=0), corners.max(axis=0)
    return BoardView(
        name=picture.name,
        board=board,
        picture_size=picture.size,
        corners_px=corners,
        homography_rms_px=float(np.sqrt(np.mean(off**2))),
        homography_max_px=float(off.max()),
        grid_rms_px=float(np.sqrt(np.mean(rest**2))),
        grid_max_px=float(rest.max()),
        square_px=float(np.median(np.concatenate([s.ravel() for s in steps]))),
        edge_width_px=float(_EDGE_OF_SIGMA * np.median(grid.sigma_px)),
        contrast=float(2.0 * np.median(np.abs(grid.amplitude))),
        saturated_share=_saturated_share(picture, grid.corners_px),
        bounding_box_px=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        tilt_deg=_tilt_deg(matrix, flat.mean(axis=0)),
    )


def _grid_misfit(flat: Array, corners: Array, matrix: NDArray[Any], size: tuple[int, int]) -> Array:
    """Return how far (N) corners lie from a perspective grid bent by two radial coefficients."""
    centre = 0.5 * (np.array(size) - 1.0)
    scale = 0.5 * max(size)

    def misfit(values: Array) -> Array:
        h = np.append(values[:8], 1.0).reshape(3, 3)
        straight = (_apply(h, flat[:, 0], flat[:, 1]) - centre) / scale
        r2 = np.sum(straight**2, axis=1, keepdims=True)
        bent = straight * (1.0 + r2 * (values[8] + r2 * values[9]))
        return np.asarray((bent * scale + centre - corners).ravel())

    start = np.append(np.asarray(matrix, dtype=np.float64).ravel()[:8], [0.0, 0.0])
    fit = least_squares(misfit, start, method="lm", x_scale=np.maximum(np.abs(start), 1e-3))
    return np.asarray(np.linalg.norm(fit.fun.reshape(-1, 2), axis=1))


def _saturated_share(picture: Picture, corners: Array) -> float:
    """Return the share of the lighter half of the board that is at the end of the scale."""
    outline = np.concatenate(
        [corners[0], corners[1:, -1], corners[-1, -2::-1], corners[-2:0:-1, 0]]
    )
    left, top = np.maximum(np.floor(outline.min(axis=0)).astype(int), 0)
    right, bottom = np.ceil(outline.max(axis=0)).astype(int)
    cut = picture.rgb[top : bottom + 1, left : right + 1]
    mask = np.zeros(cut.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(outline - [left, top]).astype(np.int32)], (1.0,))
    full: NDArray[np.bool_] = np.asarray((cut >= SATURATED).any(axis=2))
    return min(1.0, 2.0 * float(np.mean(full[mask.astype(bool)])))


def _tilt_deg(matrix: NDArray[Any], at: Array) -> float:
    """Return the tilt from the foreshortening at a point of the board: arccos of short by long."""
    step = 1e-3
    x = at[0] + step * np.array([0.0, 1.0, 0.0])
    y = at[1] + step * np.array([0.0, 0.0, 1.0])
    origin, right, down = _apply(matrix, x, y)
    long, short = np.linalg.svd(np.stack([right - origin, down - origin]), compute_uv=False)
    return math.degrees(math.acos(min(1.0, short / long)))


def _check_view(view: BoardView) -> None:
    refuse = partial(InputError, where=view.name)
    if view.saturated_share > MAX_SATURATED_SHARE:
        raise refuse(
            tr("{p:.0f} % of the light squares are saturated").format(p=100 * view.saturated_share),
            advice=tr("Shorten the exposure until the light squares stay below the end of scale"),
        )
    if view.contrast < MIN_CONTRAST:
        raise refuse(
            tr("light and dark squares differ by {c:.1f} of 255 only").format(
                c=255 * view.contrast
            ),
            advice=tr("Light the board better, or lengthen the exposure"),
        )
    limit_px = min(_edge_limit_px(view.picture_size[0]), MAX_EDGE_OF_SQUARE * view.square_px)
    if view.edge_width_px > limit_px:
        raise _blurred(view.edge_width_px, limit_px, view.name)
    if (
        view.grid_rms_px > MAX_RMS_OF_SQUARE * view.square_px
        or view.grid_max_px > MAX_OFF_OF_SQUARE * view.square_px
    ):
        raise refuse(
            tr("the corners lie up to {m:.1f} px off a flat grid (squares of {s:.0f} px)").format(
                m=view.grid_max_px, s=view.square_px
            ),
            advice=tr("Use a flat board, hold it still, keep reflections and fingers off it"),
        )


def _edge_limit_px(width_px: int) -> float:
    return max(MAX_EDGE_AT_LEAST_PX, MAX_EDGE_OF_WIDTH * width_px)


def _blurred(edge_width_px: float, limit_px: float, name: str) -> InputError:
    return InputError(
        tr("the picture is blurred: edges are {e:.1f} px wide, at most {m:.1f} px will do").format(
            e=edge_width_px, m=limit_px
        ),
        where=name,
        advice=tr("Focus the camera, hold the board still, and capture the picture again"),
    )


def _refuse_other_size(grey: NDArray[np.float32], board: BoardSpec, name: str) -> None:
    """Raise an error that names the board's real size, where another size is sure."""
    rough = _detect_any_size(grey)
    if rough is None or sorted(rough.shape[:2]) == sorted(board.inner_corners):
        return
    grid = _fit_grid(grey, rough)
    if not _is_checkered(grey, grid) or _goes_on(grey, grid):
        return
    raise InputError(
        tr("the board seems to have {a} x {b} inner corners, not {w} x {h}").format(
            a=max(rough.shape[:2]),
            b=min(rough.shape[:2]),
            w=board.inner_corners[0],
            h=board.inner_corners[1],
        ),
        where=name,
        advice=_size_advice(),
    )


def _larger(board: BoardSpec, name: str) -> InputError:
    return InputError(
        tr("the board has more than {w} x {h} inner corners").format(
            w=board.inner_corners[0], h=board.inner_corners[1]
        ),
        where=name,
        advice=_size_advice(),
    )


def _size_advice() -> str:
    return tr("Correct inner_corners in session.toml, or show the whole of the stated board")


def _absent(grey: NDArray[np.float32], board: BoardSpec, name: str) -> InputError:
    """Say why no board was found: blur, or nothing like a board."""
    limit_px = _edge_limit_px(grey.shape[1])
    width_px = _sharpest_edge_px(grey)
    if width_px > limit_px:
        return _blurred(width_px, limit_px, name)
    return InputError(
        tr("no checkerboard with {w} x {h} inner corners was found").format(
            w=board.inner_corners[0], h=board.inner_corners[1]
        ),
        where=name,
        advice=tr("Show the whole board, flat, evenly lit, with a light margin around it"),
    )


def _sharpest_edge_px(grey: NDArray[np.float32]) -> float:
    """Return the 10 % to 90 % width of the picture's steepest edges, as if of full contrast."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    low, high = np.percentile(smooth, [1.0, 99.0])
    steepest = float(np.percentile(np.hypot(*np.gradient(smooth)), 99.8))
    # A Gaussian edge of sd s and height H is at most H / (s sqrt(2 pi)) steep; of s, the
    # smoothing's own pixel is taken off again.
    sigma = (high - low) / (math.sqrt(2.0 * math.pi) * max(steepest, 1e-9))
    return float(_EDGE_OF_SIGMA * math.sqrt(max(sigma**2 - 1.0, 0.0)))
