"""``gelpolight board``: a checkerboard to print."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.terminal import say
from gelpolight_core.export.board_page import caption, write_board
from gelpolight_core.optics.checkerboard import BoardSpec
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    usual = BoardSpec()
    parser = commands.add_parser("board", help=tr("write a checkerboard to print, A4 at true size"))
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.pdf")
    parser.add_argument(
        "--corners",
        type=int,
        nargs=2,
        default=usual.inner_corners,
        metavar=("ACROSS", "DOWN"),
        help=tr("where four squares meet ({w} {h} unless stated)").format(
            w=usual.inner_corners[0], h=usual.inner_corners[1]
        ),
    )
    parser.add_argument(
        "--square",
        type=float,
        default=usual.square_mm,
        metavar="MM",
        help=tr("side of a square ({s:g} unless stated)").format(s=usual.square_mm),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write the page and say what it is."""
    across, down = options.corners
    board = BoardSpec((across, down), options.square)
    write_board(board, options.output)
    say(tr("{what}: written to {path}").format(what=caption(board), path=options.output))
    return 0
