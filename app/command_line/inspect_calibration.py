"""``gelpolight inspect``: what a calibration file or a recording holds."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from app.command_line.common import quality_lines
from app.command_line.terminal import harmless, say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.recording.reader import Recording, is_recording
from gelpolight_core.response.curve import CameraResponse
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("inspect", help=tr("show what a calibration or a recording holds"))
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.set_defaults(run=run)


def response_text(response: CameraResponse | None) -> str:
    """Return in words what is undone before a picture is used."""
    if response is None:
        return tr("linear")
    return tr("departs from linear by up to {x:.1f} % of the scale").format(
        x=100.0 * response.departure
    )


def run(options: argparse.Namespace) -> int:
    """Print what the file holds."""
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
        (tr("sensor"), header.serial or tr("not stated")),
        (tr("calibration"), header.calibration_id or tr("none")),
        (tr("source"), f"{header.source} ({header.kind})" if header.source else tr("not stated")),
        (tr("made"), header.started),
        (tr("program"), header.program),
        (tr("picture"), tr("{w}x{h} px, {bits} bit").format(
            w=recording.size[0], h=recording.size[1], bits=recording.bits)),
        (tr("frames"), tr("{n} in {s:.2f} s").format(n=len(recording), s=recording.duration_s)),
        (tr("frames lost"), str(recording.lost)),
        (tr("complete"), tr("no") if recording.truncated else tr("yes")),
    ]  # fmt: skip
    rows += [(key, str(value)) for key, value in header.settings.items()]
    if header.note:
        rows.append((tr("note"), header.note))
    say(_table(rows))


def _table(rows: list[tuple[str, str]]) -> str:
    """Return what a file says, a line each."""
    return "\n".join(f"{harmless(label):<18} {harmless(value)}" for label, value in rows)


def _print_calibration(path: Path) -> None:
    """Print provenance, geometry and quality table."""
    c = read_calibration(path)
    grid = c.table.grid
    rows = [
        (tr("calibration"), c.identity),
        (tr("sensor"), c.sensor.serial),
        (tr("model"), c.model),
        (tr("verdict"), c.verdict.value),
        (tr("made"), f"{c.provenance.created} {c.provenance.operator}".strip()),
        (tr("program"), c.provenance.program_version),
        (tr("session"), f"{c.provenance.session} ({len(c.provenance.sources)} files)"),
        (tr("picture"), f"{c.camera.width}x{c.camera.height} px"),
        (tr("camera response"), response_text(c.response)),
        (tr("focal length"), f"{c.camera.fx:.2f}, {c.camera.fy:.2f} px"),
        (tr("principal point"), f"{c.camera.cx:.2f}, {c.camera.cy:.2f} px"),
        (tr("top surface"), f"{c.plane.distance_mm:.3f} mm"),
        (tr("tilt"), f"{np.degrees(np.arccos(c.plane.normal_camera[2])):.3f} deg"),
        (tr("grid"), f"{grid.shape[1]}x{grid.shape[0]} nodes, {1000 * grid.pitch_mm:.2f} um"),
    ]
    for name, led in zip(("red", "green", "blue"), c.led_positions_mm, strict=True):
        rows.append((f"{tr(name)} LED", "({:.3f}, {:.3f}, {:.3f}) mm".format(*led)))
    if c.full is not None:
        m = c.full.membrane
        shown = tr("{kept}, gloss {gloss:.2f}, roughness {roughness:.2f}, bounce {bounce:.2f}")
        kept = {"two-lobe": tr("two-lobe"), "one-dimensional": tr("one-dimensional")}
        rows.append(
            (
                tr("membrane"),
                shown.format(
                    kept=kept[c.full.membrane_kept],
                    gloss=m.gloss,
                    roughness=m.roughness,
                    bounce=m.bounce,
                ),
            )
        )
    for edit in c.provenance.edits:
        channels = ", ".join(tr(name) for name in edit.channels)
        text = tr("{part} ({channels}) {made} {operator}")
        rows.append(
            (
                tr("edited by hand"),
                text.format(
                    part=tr(edit.part), channels=channels, made=edit.made, operator=edit.operator
                ).strip(),
            )
        )
    say(_table(rows))
    say("\n".join(quality_lines(c.quality)))
