"""``gelpolight inspect``: the content of a calibration file or a recording."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from app.command_line.common import quality_lines
from app.command_line.terminal import harmless, say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.reconstruction.in_place.calibration import UNKNOWN, ClosedSensor
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording, is_recording
from gelpolight_core.report.labels import label
from gelpolight_core.sensor_calibration import MODELS, Calibration
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


def _table(rows: list[tuple[str, str]]) -> str:
    """Return the description of a file, one line per item."""
    return "\n".join(f"{harmless(label):<18} {harmless(value)}" for label, value in rows)


def _print_calibration(path: Path) -> None:
    """Print provenance, geometry and quality table."""
    c = read_calibration(path)
    p, grid = c.provenance, c.table.grid
    channels = tr("{part} ({channels}) {made} {operator}")
    response = tr("linear")
    if c.response is not None:
        text = tr("up to {x:.1f} % of full scale from linear")
        response = text.format(x=100.0 * c.response.departure)
    rows = [
        (tr("calibration"), c.identity),
        (tr("sensor"), c.serial),
        (tr("elastomer"), p.elastomer or tr("not stated")),
        (tr("model"), c.model),
        (tr("verdict"), c.verdict.value),
        *([(tr("used although it failed"), p.accepted)] if p.accepted else []),
        (tr("created"), f"{p.created} {p.operator}".strip()),
        (tr("program"), p.program_version),
        (tr("session"), f"{p.session} ({len(p.sources)} files)"),
        (tr("image"), f"{c.camera.width}x{c.camera.height} px"),
        (tr("camera response"), response),
        (tr("grid"), f"{grid.shape[1]}x{grid.shape[0]} nodes, {1000 * grid.pitch_mm:.2f} um"),
        *ROWS[c.model](c),
        *(
            (
                tr("edited by hand"),
                channels.format(
                    part=label(edit.part),
                    channels=", ".join(label(name) for name in edit.channels),
                    made=edit.made,
                    operator=edit.operator,
                ).strip(),
            )
            for edit in p.edits
        ),
    ]
    say(_table(rows))
    say("\n".join(quality_lines(c.quality)))


def _in_place_rows(calibration: Calibration) -> list[tuple[str, str]]:
    """Return the scale and the balls of a closed sensor's calibration."""
    c = calibration.data_of(ClosedSensor)
    model = c.in_place
    return [
        (
            tr("scale"),
            tr("{s:.5f} mm per px, sd {sd:.2g} %").format(
                s=model.grid.mm_per_px, sd=100.0 * model.scale_sd
            ),
        ),
        (
            tr("balls"),
            tr("{n}, slopes up to {deg:.1f} deg").format(
                n=len(c.balls), deg=np.degrees(np.arctan(model.steepest))
            ),
        ),
        (tr("not known"), ", ".join(UNKNOWN)),
    ]


def _open_rows(calibration: Calibration) -> list[tuple[str, str]]:
    """Return the geometry and the membrane of an open sensor's calibration."""
    c = calibration.open_sensor
    rows = [
        (tr("focal length"), f"{c.camera.fx:.2f}, {c.camera.fy:.2f} px"),
        (tr("principal point"), f"{c.camera.cx:.2f}, {c.camera.cy:.2f} px"),
        (tr("top surface"), f"{c.plane.distance_mm:.3f} mm"),
        (tr("tilt"), f"{np.degrees(np.arccos(c.plane.normal_camera[2])):.3f} deg"),
    ]
    names = tr("red LED"), tr("green LED"), tr("blue LED")
    for name, led in zip(names, c.led_positions_mm, strict=True):
        rows.append((name, "({:.3f}, {:.3f}, {:.3f}) mm".format(*led)))
    visible_mm = Reconstructor(calibration).visible_depth_mm
    if visible_mm is not None:
        rows.append((tr("Smallest visible depth"), f"{1e3 * visible_mm:.0f} um"))
    if c.full is not None:
        m = c.full.membrane
        shown = tr(
            "{kept}, gloss {gloss:.2f}, roughness {roughness:.2f}, "
            "interreflection {interreflection:.2f}"
        ).format(
            kept=label(c.full.membrane_kept),
            gloss=m.gloss,
            roughness=m.roughness,
            interreflection=m.interreflection,
        )
        rows.append((tr("membrane"), shown))
    return rows


ROWS: Mapping[str, Callable[[Calibration], list[tuple[str, str]]]] = MappingProxyType(
    {**dict.fromkeys(MODELS, _open_rows), IN_PLACE: _in_place_rows}
)
