"""``gelpolight inspect``: the content of a calibration file or a recording."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from app.command_line.common import quality_lines
from app.command_line.terminal import harmless, say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording, is_recording
from gelpolight_core.report.facts import head_facts, stage_facts
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("file", type=Path, metavar="FILE")


def run(options: argparse.Namespace) -> int:
    """Print the content of the file."""
    if is_recording(options.file):
        with Recording.open(options.file) as recording:
            _print_recording(recording)
    else:
        _print_calibration(options.file)
    return 0


def _print_recording(recording: Recording) -> None:
    header = recording.header
    rows = [
        (tr("recording"), recording.path.name),
        (tr("sensor"), header.serial or tr("not given")),
        (tr("calibration"), header.calibration_id or tr("none")),
        (tr("source"), f"{header.source} ({header.kind})" if header.source else tr("not given")),
        (tr("created"), header.started),
        (tr("program"), header.program),
        (tr("image"), tr("{w}x{h} px, {bits} bit").format(
            w=recording.size[0], h=recording.size[1], bits=recording.bits)),
        (tr("frames"), tr("{n} in {s:.2f} s").format(n=len(recording), s=recording.duration_s)),
        (tr("frames lost"), str(recording.lost)),
        (tr("complete"), tr("no") if recording.truncated else tr("yes")),
    ]  # fmt: skip
    rows += [(key, str(value)) for key, value in header.settings.items()]
    if header.note:
        rows.append((tr("note"), header.note))
    say(_table(rows))


def _table(rows: Iterable[tuple[str, str]]) -> str:
    """Return the description of a file, one line per item."""
    return "\n".join(f"{harmless(label):<18} {harmless(value)}" for label, value in rows)


def _print_calibration(path: Path) -> None:
    """Print what is known of the sensor, the results of every stage, and the quality table."""
    c = read_calibration(path)
    rows = [*head_facts(c), (tr("Verdict"), c.verdict.value)]
    for facts in stage_facts(c).values():
        rows += facts
    visible_mm = Reconstructor(c).visible_depth_mm
    if visible_mm is not None:
        rows.append((tr("Smallest visible depth"), f"{1e3 * visible_mm:.0f} um"))
    say(_table(rows))
    say("\n".join(quality_lines(c.quality)))
