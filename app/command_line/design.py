"""``gelpolight design``: checks a sensor design before it is built."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.command_line.common import StageProgress, quality_lines, refuse_overwriting
from app.command_line.terminal import say
from gelpolight_core.design.sensor_design import read_design
from gelpolight_core.design_check.check import check_design
from gelpolight_core.design_check.reflections import Reflection
from gelpolight_core.io.atomic import refuse_unwritable, write_atomically
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from gelpolight_core.simulation.directional import ShadowComparison


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument("design", type=Path, metavar="FILE")
    parser.add_argument(
        "--shadows",
        type=Path,
        metavar="PNG",
        help=tr(
            "draw shadow area under this design's LEDs and under directional light"
            " (the paper's Fig. 1)"
        ),
    )
    parser.add_argument(
        "--lighting",
        action="store_true",
        help=tr(
            "press a cylinder under this design's LEDs and under directional light, and compare"
            " shadow and depth error of both methods (takes a minute)"
        ),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the check of the design, and the comparison of shadows if requested."""
    if options.shadows:
        refuse_overwriting([options.shadows], [options.design])
        refuse_unwritable(options.shadows)
    design = read_design(options.design)
    result = check_design(design)
    say("\n".join(quality_lines({tr("design"): result.quality})))
    say("\n".join(reflection_lines(result.reflections)))
    if options.shadows:
        # A late import, as it loads the plotting library.
        from gelpolight_core.simulation.directional import draw_shadow_comparison, shadow_comparison

        comparison = shadow_comparison(design.leds, decay_mm=design.membrane.decay_length_mm)
        write_atomically(options.shadows, partial(draw_shadow_comparison, comparison))
        say("\n".join(shadow_lines(comparison)))
    if options.lighting:
        from gelpolight_core.design_check.lighting import compare_lighting, lighting_lines

        with StageProgress() as progress:
            rows = compare_lighting(design, progress=progress)
        say("\n".join(lighting_lines(rows)))
    return 0


def reflection_lines(reflections: Sequence[Reflection]) -> list[str]:
    """Return the pixels where a flat face could mirror an LED if there were air behind it."""
    lines = [tr("pixels where a face would mirror an LED if there were air behind it:")]
    for r in reflections:
        position = tr("pixel ({u:.0f}, {v:.0f})").format(u=r.pixel[0], v=r.pixel[1])
        seen = tr("inside the image") if r.in_image else tr("outside the image")
        lines.append(f"  {r.led}  {r.face:<18} {position:<22} {seen}, {100 * r.reflectance:.1f} %")
    return lines


def shadow_lines(comparison: ShadowComparison) -> list[str]:
    """Return the comparison of shadows as a table."""
    head = tr("shadow of a {d:g} mm cylinder (mm2)").format(d=comparison.diameter_mm)
    depth, one, any_light = tr("depth mm"), tr("one light"), tr("any light")
    lines = [head, f"{'':<26}{depth:>10}{one:>12}{any_light:>12}"]
    for row in comparison.rows:
        unit = "mm" if row.lighting == "point" else "deg"
        light = tr("point") if row.lighting == "point" else tr("directional")
        setting = f"{light} {row.setting:g} {unit}"
        lines.append(
            f"{setting:<26}{row.depth_mm:>10.2f}{row.mean_shadow_mm2:>12.1f}"
            f"{row.any_shadow_mm2:>12.1f}"
        )
    return lines
