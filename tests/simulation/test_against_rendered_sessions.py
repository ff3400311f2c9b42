"""The virtual sensor agrees with an independent path tracer on the same sensor."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from gelpolight_core.design.parts import (
    CameraDesign,
    LayerDesign,
    LedDesign,
    LedRing,
    MembraneDesign,
    PhotometryDesign,
)
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.rays import sensor_axes
from gelpolight_core.simulation.surface import PressedSurface
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    Mirror,
    PressedMembrane,
    VirtualSensor,
    Whiteboard,
)


def design_of(folder: Path) -> SensorDesign:
    """Build the design that a rendered session's truth describes."""
    truth = json.loads((folder / "truth.json").read_text())
    normal = np.array(truth["top_plane"]["normal_camera"])
    camera = truth["camera"]
    window = 2.0 if folder.name.endswith("B") else 0.0
    layers = LayerDesign(
        top_distance_mm=truth["top_plane"]["offset_mm"],
        tilt_deg=math.degrees(math.acos(min(1.0, normal[2]))),
        tilt_azimuth_deg=math.degrees(math.atan2(normal[1], normal[0])),
        window_thickness_mm=window,
    )
    axes = sensor_axes(layers)
    foot = layers.top_distance_mm * normal
    leds = []
    for led in truth["leds"].values():
        x, y, z = axes @ (np.array(led["camera_mm"]) - foot)
        leds.append(LedDesign(x, y, -z, led["relative_power"]))
    membrane: dict[str, Any] = truth["membrane"]
    if membrane["kind"] == "diffuse":
        coat = MembraneDesign(diffuse_reflectance=membrane["reflectance"], specular_weight=0.0)
    else:
        coat = MembraneDesign(
            diffuse_reflectance=membrane["diffuse"],
            specular_weight=membrane["spec_weight"],
            roughness=membrane["alpha"],
            specular_reflectance=0.91 * membrane["spec_scale"],
        )
    return SensorDesign(
        serial=folder.name,
        camera=CameraDesign(
            fx=camera["fx"],
            fy=camera["fy"],
            cx=camera["cx"],
            cy=camera["cy"],
            distortion=tuple(camera["k1_k2_p1_p2"]),
            blur_sigma_px=truth["photometry"]["psf_gaussian_sigma_px"],
        ),
        layers=layers,
        leds=tuple(leds),
        ring=LedRing(),
        membrane=MembraneDesign(
            **{
                name: getattr(coat, name)
                for name in (
                    "diffuse_reflectance",
                    "specular_weight",
                    "specular_reflectance",
                    "roughness",
                )
            },
            variation=0.0,
            speck_count=0,
        ),
        photometry=PhotometryDesign(
            crosstalk=tuple(tuple(row) for row in truth["crosstalk_camera_from_led"])
        ),
    )


def picture_of(path: Path) -> np.ndarray:
    """Return a rendered picture as linear RGB, 0..1."""
    return cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1] / 255.0


def surface_of(path: Path) -> PressedSurface:
    """Return the depth map that a press was rendered from."""
    with np.load(path) as truth:
        return PressedSurface(
            truth["depth_mm"].astype(float),
            truth["contact"],
            float(truth["x0_mm"]),
            float(truth["y0_mm"]),
            float(truth["pitch_mm"]),
        )
