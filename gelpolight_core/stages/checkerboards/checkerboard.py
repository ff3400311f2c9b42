"""Find a checkerboard in an image and locate its corners to a few hundredths of a pixel.

OpenCV's detectors propose where a board may be (:mod:`.board_search`). Every corner is then located
by fitting a model of two crossing edges (:mod:`.corner_refinement`), and a board counts as found
only if the corners alternate in sign like those of a checkerboard, lie on a perspective grid, and
the pattern ends where the session says (:mod:`.board_grid`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec

from .board_exposure import (
    EDGE_OF_SIGMA,
    MIN_CONTRAST,
    blur_error,
    check_exposure,
    edge_limit_px,
    saturated_share,
    sharpest_edge_px,
)
from .board_grid import continues_beyond_grid, foreshortening_tilt_deg, grid_misfit_px, is_checkered
from .board_search import find_rough_corners, search_any_size, search_rough_corners
from .corner_refinement import RefinedCorners, refine_corner_grid

# The lines of a printed board are accurate to about 0.5 % of a square; a wrong corner is off by 50
# %.
MAX_RMS_OF_SQUARE = 0.02
MAX_OFF_OF_SQUARE = 0.08


@dataclass(frozen=True, slots=True)
class BoardView:
    """A checkerboard found in one image.

    Attributes
    ----------
    name : str
        Name of the image.
    board : BoardSpec
        The board.
    image_size : (width, height)
        Size of the image, in pixels.
    corners_px : (N, 2)
        (u, v) of the inner corners, row by row, in the order of ``board.points_mm``; in the image,
        rows follow columns clockwise, as on the board's printed side.
    grid_rms_px, grid_max_px : float
        Distance of the corners from a perspective grid after two radial distortion coefficients,
        which exclude most of the lens.
    square_px : float
        Median side of a square.
    edge_width_px : float
        Sharpness: 10 % to 90 % width of the squares' edges, median over the corners.
    contrast : float
        Light squares minus dark squares, 0..1.
    saturated_share : float
        Saturated share of the light squares' area.
    tilt_deg : float
        Tilt against the viewing direction, from the foreshortening (no camera needed).
    """

    name: str
    board: BoardSpec
    image_size: tuple[int, int]
    corners_px: Float64Array
    grid_rms_px: float
    grid_max_px: float
    square_px: float
    edge_width_px: float
    contrast: float
    saturated_share: float
    tilt_deg: float


def find_board(
    image: LinearImage, board: BoardSpec, *, rough: Float64Array | None = None
) -> BoardView:
    """Find the inner corners of a checkerboard, and verify that it is the stated one.

    Parameters
    ----------
    image : LinearImage
        Any size; colours are averaged.
    board : BoardSpec
        The expected board.
    rough : (rows, columns, 2), optional
        The corners to a pixel or two, from :mod:`.board_search`; without it they are searched for
        with every detector.

    Returns
    -------
    BoardView
        The corners and their quality.

    Raises
    ------
    InputError
        If the image is black, uniform, saturated or blurred, shows no board, or shows a board with
        another number of squares.
    """
    red, green, blue = (image.rgb[..., k] for k in range(3))
    grey = np.asarray((red + green + blue) / np.float32(3.0), dtype=np.float32)
    check_exposure(grey, image.name)
    if rough is None:
        rough = find_rough_corners(grey, board.inner_corners)
    if rough is None:
        if (other_size := _other_size(grey, board, image.name)) is not None:
            raise other_size
        rough = search_rough_corners(grey, board.inner_corners)
    if rough is None:
        raise _absent(grey, board, image.name)
    grid = refine_corner_grid(grey, rough)
    if not is_checkered(grey, grid):
        raise _other_size(grey, board, image.name) or _absent(grey, board, image.name)
    if continues_beyond_grid(grey, grid):
        columns, rows = board.inner_corners
        text = f"The board has more than {columns} x {rows} inner corners"
        larger = InputError(text, image.name, Remedy.BOARD_SIZE)
        raise _other_size(grey, board, image.name) or larger
    view = _describe(image, grey, board, grid)
    _check_view(view)
    return view


def _describe(
    image: LinearImage, grey: Float32Array, board: BoardSpec, grid: RefinedCorners
) -> BoardView:
    corners = np.ascontiguousarray(grid.corners_px.reshape(-1, 2))
    flat = board.points_mm[:, :2]
    matrix, _ = cv2.findHomography(flat, corners)
    residual_px = grid_misfit_px(flat, corners, matrix, image.size)
    steps = [np.linalg.norm(np.diff(grid.corners_px, axis=axis), axis=-1) for axis in (0, 1)]
    return BoardView(
        name=image.name,
        board=board,
        image_size=image.size,
        corners_px=corners,
        grid_rms_px=float(np.sqrt(np.mean(residual_px**2))),
        grid_max_px=float(residual_px.max()),
        square_px=float(np.median(np.concatenate([s.ravel() for s in steps]))),
        edge_width_px=float(EDGE_OF_SIGMA * np.median(grid.sigma_px)),
        contrast=float(2.0 * np.median(np.abs(grid.amplitude))),
        saturated_share=saturated_share(image, grid.corners_px),
        tilt_deg=foreshortening_tilt_deg(matrix, flat.mean(axis=0)),
    )


def _check_view(view: BoardView) -> None:
    # If half of the light squares are clipped, their edges have no reliable level.
    if view.saturated_share > 0.5:
        text = f"{100 * view.saturated_share:.0f} % of the light squares are saturated"
        raise InputError(text, view.name, Remedy.SHORTER_EXPOSURE)
    if view.contrast < MIN_CONTRAST:
        text = f"Light and dark squares differ by only {255 * view.contrast:.1f} of 255"
        raise InputError(text, view.name, Remedy.LIGHT_ON)
    # An edge wider than a third of a square runs into the next edge.
    limit_px = min(edge_limit_px(view.image_size[0]), 1.0 / 3.0 * view.square_px)
    if view.edge_width_px > limit_px:
        raise blur_error(view.edge_width_px, limit_px, view.name)
    if (
        view.grid_rms_px > MAX_RMS_OF_SQUARE * view.square_px
        or view.grid_max_px > MAX_OFF_OF_SQUARE * view.square_px
    ):
        text = (
            f"The corners deviate by up to {view.grid_max_px:.1f} px from a flat grid "
            f"(squares of {view.square_px:.0f} px)"
        )
        raise InputError(text, view.name, Remedy.FLAT_BOARD)


def _other_size(grey: Float32Array, board: BoardSpec, name: str) -> InputError | None:
    """Return an error with the actual board size, if another size is certain."""
    rough = search_any_size(grey)
    if rough is None or sorted(rough.shape[:2]) == sorted(board.inner_corners):
        return None
    grid = refine_corner_grid(grey, rough)
    if not is_checkered(grey, grid) or continues_beyond_grid(grey, grid):
        return None
    long, short = max(rough.shape[:2]), min(rough.shape[:2])
    columns, rows = board.inner_corners
    text = f"The board seems to have {long} x {short} inner corners, not {columns} x {rows}"
    return InputError(text, name, Remedy.BOARD_SIZE)


def _absent(grey: Float32Array, board: BoardSpec, name: str) -> InputError:
    """Return the error for a board that was not found: blur, or no board at all."""
    limit_px = edge_limit_px(grey.shape[1])
    width_px = sharpest_edge_px(grey)
    if width_px > limit_px:
        return blur_error(width_px, limit_px, name)
    columns, rows = board.inner_corners
    text = f"No checkerboard with {columns} x {rows} inner corners was found"
    return InputError(text, name, Remedy.SHOW_BOARD)
