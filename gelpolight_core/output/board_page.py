"""A checkerboard to print: an A4 page at true scale, with a ruler to check the printed size."""

from __future__ import annotations

import io
from pathlib import Path

from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.session.board import BoardSpec

from .drawing_thread import Axes, Figure, Line2D, Rectangle, in_drawing_thread, rc_context

A4_MM = (210.0, 297.0)
MM_PER_INCH = 25.4
ENDING = ".pdf"
RULER_MM = 50.0
# Margin that printers leave white; ruler and text are in a strip of this height at the foot.
MARGIN_MM = 10.0
FOOT_MM = 38.0
# The detector needs light around the board: cut no closer than this number of squares.
QUIET_SQUARES = 1.5
CUT_MM = 4.0


@in_drawing_thread
def write_board(board: BoardSpec, path: Path) -> None:
    """Write a checkerboard as a PDF page at true scale, completely or not at all.

    Parameters
    ----------
    board : BoardSpec
        Corners and squares.
    path : Path
        Its name must end in ``.pdf``.

    Raises
    ------
    InputError
        If the board does not fit the paper, the name has another extension, or the file cannot be
        written.
    """
    if path.suffix.lower() != ENDING:
        raise InputError(
            "A board is written as PDF, so its name must end in .pdf", path, Remedy.CHOOSE_NAME
        )
    stream = io.BytesIO()
    information = {"Title": caption(board), "Creator": "GelPoLight Studio", "CreationDate": None}
    with rc_context({"pdf.fonttype": 42}):
        draw_board(board).savefig(stream, format="pdf", metadata=information)
    write_atomically(path, lambda file: file.write(stream.getvalue()))


def caption(board: BoardSpec) -> str:
    """Return a description of a board."""
    return (
        f"Checkerboard: {board.inner_corners[0]} x {board.inner_corners[1]} "
        f"inner corners, squares of {board.square_mm:g} mm"
    )


def draw_board(board: BoardSpec) -> Figure:
    """Return the page as a figure of the paper's size.

    Raises
    ------
    InputError
        If the board does not fit the paper.
    """
    across, down = (n + 1 for n in board.inner_corners)
    width, height = across * board.square_mm, down * board.square_mm
    page = _paper(width, height, board)
    figure = Figure(figsize=(page[0] / MM_PER_INCH, page[1] / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, page[0])
    axes.set_ylim(page[1], 0.0)
    axes.axis("off")
    left, top = 0.5 * (page[0] - width), 0.5 * (page[1] - FOOT_MM - height)
    for row in range(down):
        for column in range(row % 2, across, 2):
            corner = left + column * board.square_mm, top + row * board.square_mm
            side = board.square_mm
            # If snapped to raster pixels, squares would differ in size.
            axes.add_patch(Rectangle(corner, side, side, color="black", linewidth=0, snap=False))
    quiet = QUIET_SQUARES * board.square_mm
    _cut_marks(axes, (left - quiet, top - quiet), (left + width + quiet, top + height + quiet))
    _foot(axes, page, board)
    return figure


def _paper(width_mm: float, height_mm: float, board: BoardSpec) -> tuple[float, float]:
    """Return the size of the page, in portrait format if the board fits."""
    around = 2.0 * (MARGIN_MM + QUIET_SQUARES * board.square_mm)
    for page in (A4_MM, A4_MM[::-1]):
        if width_mm + around <= page[0] and height_mm + around + FOOT_MM <= page[1]:
            return page
    text = f"A board of {width_mm:.0f} x {height_mm:.0f} mm does not fit on an A4 page"
    raise InputError(text, caption(board), Remedy.BOARD_SIZE)


def _cut_marks(axes: Axes, first: tuple[float, float], last: tuple[float, float]) -> None:
    """Mark the corners of the area to cut out, with nothing dark near the squares."""
    for x, outward_x in ((first[0], -CUT_MM), (last[0], CUT_MM)):
        for y, outward_y in ((first[1], -CUT_MM), (last[1], CUT_MM)):
            for ends in (((x, x + outward_x), (y, y)), ((x, x), (y, y + outward_y))):
                axes.add_line(Line2D(*ends, color="0.45", linewidth=0.4))


def _foot(axes: Axes, page: tuple[float, float], board: BoardSpec) -> None:
    """Draw the ruler and the printing instructions."""
    left, y = 0.5 * (page[0] - RULER_MM), page[1] - FOOT_MM + 8.0
    axes.add_line(
        Line2D((left, left + RULER_MM), (y, y), color="black", linewidth=0.6, solid_capstyle="butt")
    )
    for number in range(int(RULER_MM / 10.0) + 1):
        x = left + 10.0 * number
        tick = 3.0 if number in (0, int(RULER_MM / 10.0)) else 1.8
        axes.add_line(Line2D((x, x), (y - tick, y), color="black", linewidth=0.3))
    lines = (
        f"{RULER_MM:.0f} mm",
        caption(board),
        "Print at 100 %, not fitted to the page: the line above must be 50.0 mm long.",
        (
            "Glue the board onto a flat plate, measure all squares together, and enter the side "
            "of one square."
        ),
    )
    for number, text in enumerate(lines):
        axes.text(0.5 * page[0], y + 5.0 + 5.0 * number, text, ha="center", va="center", fontsize=8)
