"""``gelpolight board``: a checkerboard to print."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.output.board_page import caption, write_board
from gelpolight_core.session.board import BoardSpec

from .options import Command, option, output
from .terminal import print_safe

BOARD = BoardSpec()


@dataclass(frozen=True)
class BoardCommand(Command):
    """A checkerboard to print."""

    output: Path = output("FILE.pdf")
    corners: tuple[int, int] = option(
        "inner corners, where four squares meet (default: "
        f"{BOARD.inner_corners[0]} {BOARD.inner_corners[1]})",
        default=BOARD.inner_corners,
        metavar=("ACROSS", "DOWN"),
    )
    square: float = option(
        f"side of a square in mm (default: {BOARD.square_mm:g})",
        default=BOARD.square_mm,
        metavar="MM",
    )

    def run(self) -> None:
        """Write the page and print its description."""
        columns, rows = self.corners
        board = BoardSpec((columns, rows), self.square)
        write_board(board, self.output)
        print_safe(f"{caption(board)}: saved to {self.output}")
