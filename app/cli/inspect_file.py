"""``gelpolight inspect``: the content of a calibration file or a recording."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.output.report.facts import head_facts, stage_facts
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .common import quality_lines
from .options import Command, positional
from .terminal import escape_control, print_safe


@dataclass(frozen=True)
class InspectCommand(Command):
    """The content of a file."""

    file: Path = positional("FILE")

    def run(self) -> None:
        """Print the content of the file."""
        if is_recording(self.file):
            with Recording.open(self.file) as recording:
                print_safe(_table(_recording_facts(recording)))
            return
        c = read_calibration(self.file)
        rows = [*head_facts(c), ("Verdict", c.verdict.value)]
        for facts in stage_facts(c).values():
            rows += facts
        visible_mm = Reconstructor(c).visible_depth_mm
        if visible_mm is not None:
            rows.append(("Smallest visible depth", f"{1e3 * visible_mm:.0f} µm"))
        print_safe(_table(rows))
        print_safe("\n".join(quality_lines(c.quality)))


def _recording_facts(recording: Recording) -> list[tuple[str, str]]:
    header, (w, h) = recording.header, recording.size
    rows = [
        ("recording", recording.path.name),
        ("sensor", header.serial or "not given"),
        ("calibration", header.calibration_id or "none"),
        ("source", f"{header.source} ({header.kind})" if header.source else "not given"),
        ("created", header.started),
        ("program", header.program),
        ("image", f"{w}x{h} px, {recording.bits} bit"),
        ("frames", f"{len(recording)} in {recording.duration_s:.2f} s"),
        ("frames lost", str(recording.lost)),
        ("complete", "no" if recording.truncated else "yes"),
    ]
    rows += [(key, str(value)) for key, value in header.settings.items()]
    return [*rows, ("note", header.note)] if header.note else rows


def _table(rows: Iterable[tuple[str, str]]) -> str:
    """Return the description of a file, one line per item."""
    return "\n".join(
        f"{escape_control(label):<18} {escape_control(value)}" for label, value in rows
    )
