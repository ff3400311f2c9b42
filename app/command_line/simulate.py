"""``gelpolight simulate``: a session folder of the virtual sensor, with true depths."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.common import stage_progress
from app.command_line.terminal import say
from gelpolight_core.design.sensor_design import SensorDesign, read_design
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("output", type=Path, metavar="OUT")
    parser.add_argument("--design", type=Path, metavar="FILE", help=tr("sensor design (TOML)"))
    parser.add_argument(
        "--closed",
        action="store_true",
        help=tr("background, balls and scale only, as of a sensor that cannot be opened"),
    )


def run(options: argparse.Namespace) -> int:
    """Render the session."""
    design = read_design(options.design) if options.design else SensorDesign()
    with stage_progress() as progress:
        simulate_session(design, options.output, closed=options.closed, progress=progress)
    say(tr("Session saved to {folder}").format(folder=options.output))
    return 0
