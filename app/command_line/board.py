"""``gelpolight board``: a checkerboard to print."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.terminal import say
from gelpolight_core.export.board_page import caption, write_board
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    usual = BoardSpec()
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.pdf")
    parser.add_argument(
        "--corners",
        type=int,
        nargs=2,
        default=usual.inner_corners,
        metavar=("ACROSS", "DOWN"),
        help=tr("inner corners, where four squares meet (default: {w} {h})").format(
            w=usual.inner_corners[0], h=usual.inner_corners[1]
        ),
    )
    parser.add_argument(
        "--square",
        type=float,
        default=usual.square_mm,
        metavar="MM",
        help=tr("side of a square in mm (default: {s:g})").format(s=usual.square_mm),
    )


def run(options: argparse.Namespace) -> int:
    """Write the page and print its description."""
    across, down = options.corners
    board = BoardSpec((across, down), options.square)
    write_board(board, options.output)
    say(tr("{what}: saved to {path}").format(what=caption(board), path=options.output))
    return 0
