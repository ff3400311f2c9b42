"""``gelpolight inspect``: what a calibration file holds."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from app.command_line.common import quality_lines
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.response.curve import CameraResponse
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("inspect", help=tr("show what a calibration holds"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.set_defaults(run=run)


def response_text(response: CameraResponse | None) -> str:
    """Return in words what is undone before a picture is used."""
    if response is None:
        return tr("linear")
    return tr("departs from linear by up to {x:.1f} % of the scale").format(
        x=100.0 * response.departure
    )


def run(options: argparse.Namespace) -> int:
    """Print provenance, geometry and quality table."""
    c = read_calibration(options.calibration)
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
    print("\n".join(f"{label:<18} {value}" for label, value in rows))
    print("\n".join(quality_lines(c.quality)))
    return 0
