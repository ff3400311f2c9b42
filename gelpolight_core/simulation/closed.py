"""The virtual sensor closed: what the owner of a bonded membrane can capture of it."""

from __future__ import annotations

import json

import numpy as np

from gelpolight_core.simulation.plan import camera_table
from gelpolight_core.simulation.virtual_sensor import VirtualSensor

CLOSED_STAGES = ("background", "balls", "presses")
"""Image folders of a closed sensor's session; presses are for checking it."""


def mm_per_px(sensor: VirtualSensor) -> tuple[float, float]:
    """Return the mean size of a pixel on the membrane, and how much it varies over the image.

    Parameters
    ----------
    sensor : VirtualSensor
        Its rays know where each pixel sees the flat membrane.
    """
    rays = sensor.rays
    inside = np.hypot(rays.x_mm, rays.y_mm) < 0.5 * sensor.design.membrane.working_diameter_mm
    steps = np.stack(
        [
            np.hypot(np.gradient(rays.x_mm, axis=axis), np.gradient(rays.y_mm, axis=axis))
            for axis in (0, 1)
        ]
    )[:, inside]
    return float(steps.mean()), float(steps.std())


def closed_session_toml(sensor: VirtualSensor) -> str:
    """Return the content of session.toml of the closed sensor."""
    design = sensor.design
    scale, spread = mm_per_px(sensor)
    balls = "\n".join(
        f'"ball_{number:02d}.png" = {ball.radius_mm!r}' for number, ball in enumerate(design.balls)
    )
    return f"""format = "gelpolight-session"
version = 1

[sensor]
serial = {json.dumps(design.serial)}

[in_place]
mm_per_px = {scale:.7f}
mm_per_px_sd = {spread:.7f}

[balls]
{balls}
{camera_table(design)}"""
