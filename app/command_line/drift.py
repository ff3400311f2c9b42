"""``gelpolight drift``: how far an untouched sensor has moved from its calibration."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.command_line.common import (
    load_reconstructor,
    quality_lines,
    read_frame,
    refuse_overwriting,
    write_json,
)
from app.command_line.terminal import say
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.reconstruction.drift import background_drift, zeroed
from gelpolight_core.translation import tr
from gelpolight_core.who import user_name


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "drift", help=tr("compare a picture of the untouched sensor with the calibration's")
    )
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument(
        "--zero",
        type=Path,
        metavar="FILE",
        help=tr("write the calibration with this picture as its background"),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compare, print the figures, and write the calibration that is set to zero."""
    outputs = [path for path in (options.json, options.zero) if path is not None]
    refuse_overwriting(outputs, [options.calibration, options.image])
    for path in outputs:
        refuse_unwritable(path)
    reconstructor = load_reconstructor(options.calibration)
    frame = read_frame(options.image, reconstructor)
    drift = background_drift(frame, reconstructor.calibration)
    say("\n".join(quality_lines({tr("background"): drift.quality})))
    if options.json:
        content = {
            "touched": drift.touched,
            "shift_px": None if drift.shift_px is None else list(drift.shift_px),
            "brightness_percent": list(drift.brightness_percent),
            "differs_percent": drift.differs_percent,
            "verdict": drift.quality.verdict.value,
            "figures": drift.quality.as_rows(),
        }
        write_json(content, options.json)
    if options.zero:
        made = datetime.now(UTC).isoformat(timespec="seconds")
        new = zeroed(reconstructor.calibration, [frame], operator=user_name(), made=made)
        write_calibration(new, options.zero)
        say(tr("{name} written to {path}").format(name=new.identity, path=options.zero))
    return 0
