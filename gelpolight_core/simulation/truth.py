"""The true data of a simulated session."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gelpolight_core.base.csv_table import csv_text

from .design_parts import BallPressDesign, MembraneDesign
from .drape import contact_radius
from .indenters import BallIndenter
from .rays import camera_points
from .sensor_design import SensorDesign
from .session_plan import AVERAGED, press_names
from .virtual_sensor import VirtualSensor


def truth_csv(design: SensorDesign) -> str:
    """Return the content of presses/truth.csv."""
    rows = []
    for name, item in zip(press_names(design.presses), design.presses, strict=True):
        if item.shape in ("cylinder", "cuboid"):
            size = [item.size_mm, ""] if item.shape == "cylinder" else ["", item.size_mm]
            rows.append([f"{name}.png", item.shape, *size, item.depth_mm])
    return csv_text(("file", "shape", "diameter_mm", "side_mm", "height_mm"), rows)


def truth_table(sensor: VirtualSensor, stages: Sequence[str]) -> dict[str, Any]:
    """Return the truth behind the images, as plain values for JSON.

    Parameters
    ----------
    sensor : VirtualSensor
        That rendered them.
    stages : sequence of str
        Image folders of the session.
    """
    design = sensor.design
    camera, layers, membrane = design.camera, design.layers, design.membrane
    positions = [
        camera_points(layers, np.array([led.x_mm, led.y_mm, -led.height_mm])) for led in design.leds
    ]
    return {
        "camera": {
            "fx": camera.fx,
            "fy": camera.fy,
            "cx": camera.cx,
            "cy": camera.cy,
            "k1_k2_p1_p2": list(camera.distortion),
        },
        "top_plane": {
            "normal_camera": layers.normal_camera.tolist(),
            "offset_mm": layers.top_distance_mm,
        },
        "leds": {
            name: {
                "camera_mm": position.tolist(),
                "relative_power": led.power,
                "lobe_exponent": design.ring.lobe_exponent,
                "axis_tilt": list(led.axis_tilt),
            }
            for name, position, led in zip("RGB", positions, design.leds, strict=True)
        },
        "elastomer_absorption_per_mm": list(layers.elastomer_absorption_per_mm),
        "crosstalk_camera_from_led": [list(row) for row in design.photometry.crosstalk],
        "balls": [
            {
                "file": f"ball_{number:02d}.png",
                "radius_mm": ball.radius_mm,
                "depth_mm": ball.depth_mm,
                "contact_radius_mm": _ball_contact(ball, membrane),
                "centre_sensor_xy_mm": [ball.x_mm, ball.y_mm],
            }
            for number, ball in enumerate(design.balls)
        ],
        "membrane": {
            "apex_height_mm": membrane.apex_height_mm,
            "axis_mm": list(membrane.axis_mm),
            "kind": "blend" if membrane.specular_weight > 0.0 else "diffuse",
            "diffuse": membrane.diffuse_reflectance,
            "spec_weight": membrane.specular_weight,
            "alpha": membrane.roughness,
            "spec_scale": membrane.specular_reflectance,
            "stretch_loss": membrane.stretch_loss,
            "rho_texture": membrane.variation > 0.0 or membrane.speck_count > 0,
            "decay_length_mm": membrane.decay_length_mm,
        },
        "photometry": _photometry_table(sensor, stages),
        "transport": "direct light of the LEDs with cast shadows only"
        if membrane.bounces == 0
        else "direct light of the LEDs with cast shadows, and interreflection with at most "
        f"{membrane.bounces} reflections between parts of the membrane, directly or by the lower "
        "face",
    }


def _photometry_table(sensor: VirtualSensor, stages: Sequence[str]) -> dict[str, Any]:
    camera = sensor.design.camera
    full = 2**camera.bit_depth - 1
    signal = 200.0 / 255.0
    sd = math.sqrt(camera.shot_variance * signal + camera.read_sd**2)
    return {
        "response": {
            "linear": f"linear (gamma 1); value = {full}*linear",
            "srgb": f"sRGB (IEC 61966-2-1); value = {full}*encoded",
            "gamma": f"gamma {camera.gamma:g}; value = {full}*linear^(1/{camera.gamma:g})",
        }[camera.response],
        "exposure_membrane": sensor.exposure,
        "whiteboard_exposure_relative_to_membrane": 1.0,
        "psf_gaussian_sigma_px": camera.blur_sigma_px,
        "noise": {"shot_var_per_unit": camera.shot_variance, "read_sigma": camera.read_sd},
        "snr_db_at_200": 20.0 * math.log10(signal / sd) if sd > 0.0 else None,
        "averaged_frames": {s: AVERAGED[s] for s in stages},
    }


def _ball_contact(ball: BallPressDesign, membrane: MembraneDesign) -> float:
    # As for a flat membrane and a ball that is more strongly curved by as much as the cap is.
    radius_mm = ball.radius_mm / (1.0 + ball.radius_mm * membrane.curvature_per_mm)
    shape = BallIndenter(radius_mm, ball.depth_mm)
    return contact_radius(shape.profile, shape.reach_mm, membrane.decay_length_mm)
