"""``gelpolight design``: checks a sensor design before it is built."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from app.command_line.common import quality_lines
from app.command_line.terminal import say
from gelpolight_core.design.sensor_design import read_design
from gelpolight_core.design_check.check import check_design
from gelpolight_core.design_check.reflections import Reflection
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("design", type=Path, metavar="FILE")


def run(options: argparse.Namespace) -> int:
    """Print the check of the design."""
    result = check_design(read_design(options.design))
    say("\n".join(quality_lines({tr("design"): result.quality})))
    say("\n".join(reflection_lines(result.reflections)))
    return 0


def reflection_lines(reflections: Sequence[Reflection]) -> list[str]:
    """Return the pixels where a flat face could mirror an LED if there were air behind it."""
    lines = [tr("pixels where a face would mirror an LED if there were air behind it:")]
    for r in reflections:
        position = tr("pixel ({u:.0f}, {v:.0f})").format(u=r.pixel[0], v=r.pixel[1])
        seen = tr("inside the image") if r.in_image else tr("outside the image")
        lines.append(f"  {r.led}  {r.face:<18} {position:<22} {seen}, {100 * r.reflectance:.1f} %")
    return lines
