"""What a simulated session holds: its stages, the names of its files, its exposures."""

from __future__ import annotations

import numpy as np

from gelpolight_core.design.parts import Press
from gelpolight_core.design.sensor_design import SensorDesign

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
"""How many frames each stage's picture is the average of."""

EXPOSURE_MS = 8.0
"""Exposure time of the whiteboard's picture; only the ratios to it matter."""


def session_stages(design: SensorDesign) -> tuple[str, ...]:
    """Return the folders of pictures that a session of a design has."""
    left_out = set()
    if design.session.response_pictures == 0:
        left_out.add("response")
    if not design.session.single_led:
        left_out.add("single_led")
    return tuple(stage for stage in AVERAGED if stage not in left_out)


def exposure_series(design: SensorDesign) -> dict[str, float]:
    """Return the files of the stage ``response`` and their exposures over the whiteboard's own."""
    count = design.session.response_pictures
    exposures = np.geomspace(1.0 / 32.0, 2.0, count) if count > 1 else np.ones(count)
    return {f"exp_{number:02d}.png": float(x) for number, x in enumerate(exposures)}


def press_names(presses: tuple[Press, ...]) -> tuple[str, ...]:
    """Return a file name without suffix for each press; a repeated one gets a number."""
    names: list[str] = []
    for item in presses:
        if item.shape in ("cylinder", "cuboid"):
            name = f"{item.shape}_s{item.size_mm:g}_d{round(100 * item.depth_mm):03d}"
        else:
            name = f"object_{item.shape}"
        repeat = sum(n == name or n.startswith(f"{name}_r") for n in names)
        names.append(f"{name}_r{repeat + 1}" if repeat else name)
    return tuple(names)


def response_tables(design: SensorDesign) -> str:
    """Return what session.toml says of the camera's response and of its series, if anything."""
    camera, text = design.camera, ""
    if design.session.declares_response and camera.response != "linear":
        gamma = camera.response == "gamma"
        line = f"gamma = {camera.gamma!r}" if gamma else f'response = "{camera.response}"'
        text += f"\n[camera]\n{line}\n"
    series = exposure_series(design)
    if series:
        lines = (f'"{name}" = {EXPOSURE_MS * x!r}\n' for name, x in series.items())
        text += f"\n[response]\n{''.join(lines)}"
    return text
