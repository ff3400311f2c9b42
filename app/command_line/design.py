"""``gelpolight design``: what can be said of a sensor before it is built."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import quality_lines
from gelpolight_core.design.check import check_design
from gelpolight_core.design.sensor_design import read_design
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("design", help=tr("check a sensor design before it is built"))
    parser.add_argument("design", type=Path, metavar="FILE")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the design's check."""
    result = check_design(read_design(options.design))
    print("\n".join(quality_lines({tr("design"): result.quality})))
    return 0
