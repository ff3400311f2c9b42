"""``gelpolight calibrate``: a session folder becomes a calibration file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from app.command_line.common import (
    StageProgress,
    add_model,
    quality_lines,
    refuse_overwriting,
    session_files,
    write_json,
)
from app.command_line.terminal import say
from gelpolight_core.calibration.calibration import MODELS
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.pipeline import CalibrationRun, calibrate_session
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("calibrate", help=tr("make a calibration from a session folder"))
    parser.add_argument("session", type=Path, metavar="SESSION")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CALIBRATION")
    parser.add_argument("--json", type=Path, metavar="FILE", help=tr("results of every stage"))
    add_model(parser, default=MODELS[-1])
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Calibrate, write the file and print the quality table."""
    session = read_session(options.session)
    outputs = [path for path in (options.output, options.json) if path is not None]
    refuse_overwriting(outputs, session_files(session))
    for path in outputs:
        refuse_unwritable(path)
    with StageProgress() as tell:
        result = calibrate_session(session, model=options.model, progress=tell)
    write_calibration(result.calibration, options.output)
    if options.json:
        write_json(run_as_json(result), options.json)
    say(tr("camera response: {what}").format(what=result.response.summary))
    say("\n".join(quality_lines(result.calibration.quality)))
    say(
        tr("Calibration {id} written to {path}: {verdict}").format(
            id=result.calibration.identity,
            path=options.output,
            verdict=result.calibration.verdict.value,
        )
    )
    return 0


def run_as_json(result: CalibrationRun) -> dict[str, Any]:
    """Return the results of every stage as plain values, lengths in mm, sensor frame."""
    c = result.calibration
    camera = c.camera
    return {
        "id": c.identity,
        "model": c.model,
        "verdict": c.verdict.value,
        "response": {
            "source": result.response.source,
            "linear": c.response is None,
            "light_of_even_values": None if c.response is None else c.response.curves.tolist(),
        },
        "camera": {
            "fx": camera.fx,
            "fy": camera.fy,
            "cx": camera.cx,
            "cy": camera.cy,
            "distortion_k1_k2_p1_p2_k3": list(camera.distortion),
        },
        "top_plane": {
            "normal_camera": list(c.plane.normal_camera),
            "distance_mm": c.plane.distance_mm,
        },
        "mirror_spots_px": result.lights.spots.centres_px.tolist(),
        "led_positions_mm": c.led_positions_mm.tolist(),
        "led_positions_camera_mm": c.plane.to_camera(c.led_positions_mm).tolist(),
        "led_sd_mm": np.sqrt(np.diagonal(c.led_covariance_mm2, axis1=1, axis2=2)).tolist(),
        "crosstalk": c.crosstalk.tolist(),
        "crosstalk_source": result.crosstalk.source,
        "balls": [
            {
                "file": Path(press.name).name,
                "radius_mm": press.pose.radius_mm,
                "centre_mm": list(press.pose.centre_mm),
                "depth_mm": press.pose.depth_mm,
                "contact_radius_mm": press.contact_radius_mm,
                "centre_sd_mm": press.centre_sd_mm,
            }
            for press in result.reflectance.presses
        ],
        "reflectance": [
            {
                "cosines": fit.cosines.tolist(),
                "values": fit.values.tolist(),
                "coverage": fit.coverage.tolist(),
                "scatter": fit.spread,
            }
            for fit in result.reflectance.fits
        ],
        "quality": {stage: table.as_rows() for stage, table in c.quality.items()},
    }
