"""``gelpolight design``: what can be said of a sensor before it is built."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from app.command_line.common import quality_lines, refuse_overwriting
from app.command_line.terminal import say
from gelpolight_core.design.check import check_design
from gelpolight_core.design.reflections import Reflection
from gelpolight_core.design.sensor_design import read_design
from gelpolight_core.export.atomic import refuse_unwritable, write_atomically
from gelpolight_core.simulation.directional import (
    ShadowComparison,
    draw_shadow_comparison,
    shadow_comparison,
)
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("design", help=tr("check a sensor design before it is built"))
    parser.add_argument("design", type=Path, metavar="FILE")
    parser.add_argument(
        "--shadows",
        type=Path,
        metavar="PNG",
        help=tr("draw shadow area under point and directional light (the paper's Fig. 1)"),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the design's check, and the comparison of shadows where it is asked for."""
    if options.shadows:
        refuse_overwriting([options.shadows], [options.design])
        refuse_unwritable(options.shadows)
    result = check_design(read_design(options.design))
    say("\n".join(quality_lines({tr("design"): result.quality})))
    say("\n".join(reflection_lines(result.reflections)))
    if options.shadows:
        comparison = shadow_comparison()
        write_atomically(options.shadows, partial(draw_shadow_comparison, comparison))
        say("\n".join(shadow_lines(comparison)))
    return 0


def reflection_lines(reflections: Sequence[Reflection]) -> list[str]:
    """Return where in the picture a flat face could mirror an LED, were there air behind it."""
    lines = [tr("where a face would mirror an LED, if there were air behind it:")]
    for r in reflections:
        place = tr("pixel ({u:.0f}, {v:.0f})").format(u=r.pixel[0], v=r.pixel[1])
        seen = tr("in the picture") if r.in_picture else tr("out of the picture")
        lines.append(f"  {r.led}  {r.face:<18} {place:<22} {seen}, {100 * r.reflectance:.1f} %")
    return lines


def shadow_lines(comparison: ShadowComparison) -> list[str]:
    """Return the comparison of shadows as a table."""
    head = tr("shadow of a {d:g} mm cylinder (mm2)").format(d=comparison.diameter_mm)
    lines = [head, f"{'':<26}{tr('depth mm'):>10}{tr('one light'):>12}{tr('any light'):>12}"]
    for row in comparison.rows:
        unit = "mm" if row.lighting == "point" else "deg"
        setting = f"{tr(row.lighting)} {row.setting:g} {unit}"
        lines.append(
            f"{setting:<26}{row.depth_mm:>10.2f}{row.mean_shadow_mm2:>12.1f}"
            f"{row.any_shadow_mm2:>12.1f}"
        )
    return lines
