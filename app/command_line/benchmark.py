"""``gelpolight benchmark``: where the time of a frame goes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from app.command_line.common import (
    add_effort,
    add_model,
    load_reconstructor,
    plan_lines,
    refuse_overwriting,
    write_json,
)
from app.command_line.terminal import say
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.reconstruction.benchmark import benchmark_frame
from gelpolight_core.session.session import read_picture, require_colour
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("benchmark", help=tr("show where the time of a frame goes"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--repeats", type=int, default=25, metavar="N")
    add_effort(parser)
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Time the frame and print a table."""
    if options.json:
        refuse_overwriting([options.json], [options.calibration, options.image])
        refuse_unwritable(options.json)
    reconstructor = load_reconstructor(
        options.calibration, model=options.model, effort=options.effort
    )
    picture = read_picture(options.image)
    require_colour(picture, where=str(options.image))
    frame = np.round(picture.rgb * (2**picture.bit_depth - 1)).astype(f"u{picture.bit_depth // 8}")
    result = benchmark_frame(reconstructor, frame, repeats=max(options.repeats, 1))
    rows = [*result.steps, result.total, result.plain]
    say(f"{tr('step'):<26}{tr('median ms'):>12}{tr('p95 ms'):>10}{tr('MB'):>8}")
    for row in rows:
        say(f"{row.name:<26}{row.median_ms:12.2f}{row.p95_ms:10.2f}{row.bytes / 1e6:8.1f}")
    say(f"{tr('copy of the bytes'):<26}{result.copy_floor_ms:12.2f}")
    text = tr("{floor:.1f} times the copy")
    if reconstructor.model == "paper":
        text = tr("{ratio:.1f} times faster than the plain version; {floor:.1f} times the copy")
    say(
        text.format(
            ratio=result.plain.median_ms / result.total.median_ms,
            floor=result.total.median_ms / result.copy_floor_ms,
        )
    )
    say("\n".join(plan_lines(result.plan)))
    if options.json:
        write_json(
            {
                "total_ms": {"median": result.total.median_ms, "p95": result.total.p95_ms},
                "copy_floor_ms": result.copy_floor_ms,
                "steps": [row.as_dict() for row in result.steps],
                "plain": result.plain.as_dict(),
                "threads": result.threads,
                "model": reconstructor.model,
                "effort": reconstructor.effort,
                "plan": result.plan.as_dicts(),
                "versions": result.versions,
            },
            options.json,
        )
    return 0
