"""``gelpolight calibrate``: turns a session folder into a calibration file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from app.command_line.common import check_outputs, quality_lines, stage_progress
from app.command_line.reconstructing import add_model, report_failure
from app.command_line.sessions import session_files
from app.command_line.terminal import say
from gelpolight_core.calibration import in_place
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.open_sensor import LIGHTS, RESPONSE
from gelpolight_core.calibration.project import Run, calibrate
from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.io.atomic import write_json
from gelpolight_core.reconstruction.in_place.calibration import UNKNOWN, ClosedSensor
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("session", type=Path, metavar="SESSION")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CALIBRATION")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help=tr("write the results of every stage as JSON")
    )
    add_model(parser)


def run(options: argparse.Namespace) -> int:
    """Calibrate, write the file and print the quality table."""
    session = read_session(options.session)
    recipe = recipe_of(session, options.model)
    check_outputs([options.output, options.json], session_files(session))
    with stage_progress() as progress:
        result = calibrate(session, recipe, progress=progress)
    write_calibration(result.calibration, options.output)
    if recipe.closed:
        content, lines = in_place_as_json(result), in_place_lines(result)
    else:
        content = run_as_json(result)
        lines = [tr("camera response: {what}").format(what=result.results[RESPONSE].summary)]
    if options.json:
        write_json(options.json, content)
    say("\n".join([*lines, *quality_lines(result.calibration.quality)]))
    report_failure(result.calibration, options.output)
    say(
        tr("Calibration {id} saved to {path}: {verdict}").format(
            id=result.calibration.identity,
            path=options.output,
            verdict=result.calibration.verdict.value,
        )
    )
    return 0


def in_place_lines(run: Run) -> list[str]:
    """Return the chosen model, its unknown quantities, and the presses that were left out."""
    result = run.results[in_place.BALLS]
    lines = [
        tr("model: in-place (closed sensor: background and balls only)"),
        tr("not known: {what}").format(what=", ".join(UNKNOWN)),
        tr("balls: {n} used, {m} left out; slopes seen up to {deg:.0f} deg").format(
            n=len(result.result.presses),
            m=len(result.result.refused),
            deg=np.degrees(np.arctan(result.result.model.steepest)),
        ),
    ]
    lines += [tr("left out: {fault}").format(fault=e) for e in result.result.refused.values()]
    x, y = result.result.next_position_mm
    lines.append(tr("another ball helps most at ({x:.1f}, {y:.1f}) mm").format(x=x, y=y))
    return lines


def in_place_as_json(run: Run) -> dict[str, Any]:
    """Return a closed sensor's results as plain values, lengths in mm."""
    c, found = run.calibration, run.results[in_place.BALLS].result
    balls = c.data_of(ClosedSensor).balls
    return {
        "id": c.identity,
        "model": c.model,
        "verdict": c.verdict.value,
        "mm_per_px": found.model.grid.mm_per_px,
        "unknown": list(UNKNOWN),
        "steepest_slope": found.model.steepest,
        "balls": [
            {
                "file": name,
                "centre_mm": [x, y],
                "contact_radius_mm": contact,
                "radius_mm": radius,
                "held_out_normal_deg": press.held_out.normal_deg,
                "held_out_cap_ratio": finite(press.held_out.cap_ratio),
                "held_out_diameter_ratio": finite(press.held_out.diameter_ratio),
            }
            for (name, x, y, contact, radius), press in zip(balls, found.presses, strict=True)
        ],
        "left_out": {name: str(fault) for name, fault in found.refused.items()},
        "error_by_balls": [list(point) for point in found.learning],
        "next_ball_mm": list(found.next_position_mm),
        "quality": {stage: table.as_rows() for stage, table in c.quality.items()},
    }


def finite(value: float) -> float | None:
    """Return a number, or None where there is none."""
    return value if np.isfinite(value) else None


def run_as_json(result: Run) -> dict[str, Any]:
    """Return the results of every stage as plain values, lengths in mm, sensor frame."""
    calibration, results = result.calibration, result.results
    c = calibration.open_sensor
    camera, response, lights = c.camera, results[RESPONSE], results[LIGHTS]
    reflectance = results[REFLECTANCE].table
    return {
        "id": calibration.identity,
        "model": calibration.model,
        "verdict": calibration.verdict.value,
        "response": {
            "source": response.source,
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
        "mirror_spots_px": lights.leds.spots.centres_px.tolist(),
        "led_positions_mm": c.led_positions_mm.tolist(),
        "led_positions_camera_mm": c.plane.to_camera(c.led_positions_mm).tolist(),
        "led_sd_mm": np.sqrt(np.diagonal(c.led_covariance_mm2, axis1=1, axis2=2)).tolist(),
        "crosstalk": c.crosstalk.tolist(),
        "crosstalk_source": lights.crosstalk.source,
        "balls": [
            {
                "file": Path(press.name).name,
                "radius_mm": press.pose.radius_mm,
                "centre_mm": list(press.pose.centre_mm),
                "depth_mm": press.pose.depth_mm,
                "contact_radius_mm": press.contact_radius_mm,
                "centre_sd_mm": press.centre_sd_mm,
            }
            for press in reflectance.presses
        ],
        "reflectance": [
            {
                "cosines": fit.cosines.tolist(),
                "values": fit.values.tolist(),
                "coverage": fit.coverage.tolist(),
                "scatter": fit.spread,
            }
            for fit in reflectance.fits
        ],
        "quality": {stage: table.as_rows() for stage, table in calibration.quality.items()},
    }
