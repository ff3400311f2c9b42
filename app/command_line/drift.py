"""``gelpolight drift``: how far the background of an untouched sensor has changed."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

from app.command_line.common import check_outputs, quality_lines
from app.command_line.reconstructing import load_reconstructor, read_frame
from app.command_line.terminal import say
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.io.atomic import write_json
from gelpolight_core.io.user import user_name
from gelpolight_core.reconstruction.background_shift import background_shift, zeroed
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument(
        "--zero",
        type=Path,
        metavar="FILE",
        help=tr("write the calibration with this image as its new background"),
    )


def run(options: argparse.Namespace) -> int:
    """Compare, print the figures, and write the calibration with the new background."""
    check_outputs([options.json, options.zero], [options.calibration, options.image])
    reconstructor = load_reconstructor(options.calibration)
    frame = read_frame(options.image, reconstructor)
    shift = background_shift(frame, reconstructor.calibration)
    say("\n".join(quality_lines({tr("background"): shift.quality})))
    if options.json:
        content = {
            "touched": shift.touched,
            "shift_px": None if shift.shift_px is None else list(shift.shift_px),
            "brightness_percent": list(shift.brightness_percent),
            "differs_percent": shift.differs_percent,
            "verdict": shift.quality.verdict.value,
            "figures": shift.quality.as_rows(),
        }
        write_json(options.json, content)
    if options.zero:
        made = datetime.now(UTC).isoformat(timespec="seconds")
        new = zeroed(reconstructor.calibration, [frame], operator=user_name(), made=made)
        write_calibration(new, options.zero)
        say(tr("{name} saved to {path}").format(name=new.identity, path=options.zero))
    return 0
