"""A printed board has the stated size, and our own detector finds it."""

import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from gelpolight_core.base.errors import InputError
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.output.board_page import draw_board, write_board
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.checkerboard import find_board

DPI = 400
PX_PER_MM = DPI / 25.4
BOARDS = Path(__file__).resolve().parents[2] / "resources" / "checkerboards"


def printed(board: BoardSpec) -> np.ndarray:
    """Return the page (rows, columns, 3) as printed at 400 dpi."""
    figure = draw_board(board)
    canvas = FigureCanvasAgg(figure)
    figure.set_dpi(DPI)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(np.float32) / 255.0


@pytest.mark.parametrize(
    "board",
    [BoardSpec((9, 6), 3.0), BoardSpec((9, 6), 2.0), BoardSpec((14, 8), 12.0)],
    ids=["lens views", "top surface", "across the paper"],
)
def test_squares_have_their_size_on_the_paper(board):
    page = printed(board)
    around = round(1.2 * board.square_mm * PX_PER_MM)
    rows = np.flatnonzero((page[..., 0] < 0.2).any(axis=1))
    rows = rows[rows < len(page) - 38.0 * PX_PER_MM]
    columns = np.flatnonzero((page[rows[0] : rows[-1], :, 0] < 0.2).any(axis=0))
    cut = page[rows[0] - around : rows[-1] + around, columns[0] - around : columns[-1] + around]
    view = find_board(LinearImage("page", 0.1 + 0.8 * cut, bit_depth=8), board)
    corners = view.corners_px.reshape(board.inner_corners[1], board.inner_corners[0], 2)
    across = np.linalg.norm(corners[:, -1] - corners[:, 0], axis=-1) / PX_PER_MM
    down = np.linalg.norm(corners[-1] - corners[0], axis=-1) / PX_PER_MM
    # A tenth of a pixel of this printer.
    assert np.allclose(across, (board.inner_corners[0] - 1) * board.square_mm, atol=0.007)
    assert np.allclose(down, (board.inner_corners[1] - 1) * board.square_mm, atol=0.007)


def outlines(path: Path) -> list[bytes]:
    """Return the drawn strokes of a page, without text."""
    (page, *_) = re.findall(rb"stream\r?\n(.*?)\nendstream", path.read_bytes(), re.DOTALL)
    return re.findall(rb"(?:[\d.-]+ ){2,4}(?:m|l|re)\b", zlib.decompress(page))


def test_the_boards_that_come_with_the_program_are_those_of_the_command(tmp_path):
    for square in (2, 3):
        kept = BOARDS / f"checkerboard-9x6-{square}mm.pdf"
        write_board(BoardSpec((9, 6), float(square)), tmp_path / kept.name)
        # Other matplotlib versions draw text differently, but not the squares.
        assert len(outlines(kept)) > 54
        assert outlines(kept) == outlines(tmp_path / kept.name)


def test_a_board_that_does_not_fit_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not fit on an A4 page"):
        write_board(BoardSpec((20, 20), 15.0), tmp_path / "board.pdf")
    assert not list(tmp_path.iterdir())
