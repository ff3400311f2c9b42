"""The contents of a simulated session: stages, file names, exposures."""

from __future__ import annotations

import numpy as np

from .design_parts import PressDesign
from .sensor_design import SensorDesign

AVERAGED = {
    "checkerboard": 8,
    "top_pose": 8,
    "mirror": 8,
    "whiteboard": 8,
    "background": 8,
    "balls": 1,
    "presses": 1,
    "response": 1,
    "single_led": 8,
}
"""Number of frames averaged for the image of each stage."""


def session_stages(design: SensorDesign) -> tuple[str, ...]:
    """Return the image folders of a session of a design."""
    left_out = {"whiteboard", "response", "single_led"} if design.membrane.apex_height_mm else set()
    if design.session.response_pictures == 0:
        left_out.add("response")
    if not design.session.single_led:
        left_out.add("single_led")
    return tuple(stage for stage in AVERAGED if stage not in left_out)


def exposure_series(design: SensorDesign) -> dict[str, float]:
    """Return the files of the stage ``response`` and their exposures relative to the whiteboard."""
    count = design.session.response_pictures
    exposures = np.geomspace(1.0 / 32.0, 2.0, count) if count > 1 else np.ones(count)
    return {f"exp_{number:02d}.png": float(x) for number, x in enumerate(exposures)}


def press_names(presses: tuple[PressDesign, ...]) -> tuple[str, ...]:
    """Return a file name without suffix for each press, numbered where it repeats."""
    names: list[str] = []
    for item in presses:
        if item.shape in ("cylinder", "cuboid"):
            name = f"{item.shape}_s{item.size_mm:g}_d{round(100 * item.depth_mm):03d}"
        else:
            name = f"object_{item.shape}"
        repeat = sum(n == name or n.startswith(f"{name}_r") for n in names)
        names.append(f"{name}_r{repeat + 1}" if repeat else name)
    return tuple(names)


def half_angle_line(design: SensorDesign) -> str:
    """Return the line of session.toml for the half angle of the LEDs, or nothing."""
    angle = design.ring.nominal_half_angle_deg
    return "" if angle is None else f"led_half_angle_deg = {angle!r}\n"


def membrane_table(design: SensorDesign) -> str:
    """Return the lines of session.toml for a curved membrane, or nothing."""
    apex = design.membrane.apex_height_mm
    return f'\n[membrane]\nshape = "spherical_cap"\napex_height_mm = {apex!r}\n' if apex else ""


def camera_table(design: SensorDesign) -> str:
    """Return the lines of session.toml that declare the camera response, if any."""
    camera = design.camera
    if not design.session.declares_response or camera.response == "linear":
        return ""
    gamma = camera.response == "gamma"
    line = f"gamma = {camera.gamma!r}" if gamma else f'response = "{camera.response}"'
    return f"\n[camera]\n{line}\n"


def response_tables(design: SensorDesign) -> str:
    """Return the lines of session.toml for the camera response with its series, if any."""
    text = camera_table(design)
    series = exposure_series(design)
    if "response" in session_stages(design):
        # Only the ratios of the exposure times matter.
        lines = (f'"{name}" = {8.0 * x!r}\n' for name, x in series.items())
        text += f"\n[response]\n{''.join(lines)}"
    return text
