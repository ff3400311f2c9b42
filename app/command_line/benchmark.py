"""``gelpolight benchmark``: the time of each processing step of a frame."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import numpy as np

from app.command_line.common import check_outputs
from app.command_line.reconstructing import add_effort, add_model, load_reconstructor, trace_lines
from app.command_line.terminal import say
from gelpolight_core.io.atomic import write_json
from gelpolight_core.reconstruction.benchmark import benchmark_frame
from gelpolight_core.session.images import read_image, require_colour
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--repeats", type=int, default=25, metavar="N")
    add_effort(parser)
    add_model(parser)


def run(options: argparse.Namespace) -> int:
    """Time the frame and print a table."""
    check_outputs([options.json], [options.calibration, options.image])
    reconstructor = load_reconstructor(
        options.calibration, model=options.model, effort=options.effort
    )
    image = read_image(options.image)
    require_colour(image, where=str(options.image))
    frame = np.round(image.rgb * (2**image.bit_depth - 1)).astype(f"u{image.bit_depth // 8}")
    result = benchmark_frame(reconstructor, frame, repeats=max(options.repeats, 1))
    step, median, p95, size = tr("step"), tr("median ms"), tr("p95 ms"), tr("MB")
    say(f"{step:<26}{median:>12}{p95:>10}{size:>8}")
    for row in (*result.steps, result.total):
        say(f"{row.name:<26}{row.median_ms:12.2f}{row.p95_ms:10.2f}{row.bytes / 1e6:8.1f}")
    copy = tr("memory copy")
    say(f"{copy:<26}{result.copy_floor_ms:12.2f}")
    floor = result.total.median_ms / result.copy_floor_ms
    say(tr("{floor:.1f} times a memory copy").format(floor=floor))
    say("\n".join(trace_lines(result.trace)))
    if options.json:
        write_json(
            options.json,
            {
                "total_ms": {"median": result.total.median_ms, "p95": result.total.p95_ms},
                "copy_floor_ms": result.copy_floor_ms,
                "steps": [asdict(row) for row in result.steps],
                "threads": result.threads,
                "model": reconstructor.model,
                "effort": reconstructor.effort,
                "plan": result.trace.as_dicts(),
                "versions": result.versions,
            },
        )
    return 0
