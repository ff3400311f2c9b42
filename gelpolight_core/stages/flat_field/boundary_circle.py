"""The axis of a curved membrane: through the middle of its boundary's circle in the background."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.base.membrane_masks import LEAST_LIGHT
from gelpolight_core.base.robust import robust_fit
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.fits import circle_errors
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.geometry.refraction import LayerStack, camera_to_membrane
from gelpolight_core.geometry.resampling import paraxial_footprint_mm
from gelpolight_core.geometry.sensor_frame import TopPlane

BORDER_PX = 3
"""Points of the outline nearer to the image's border are cut off there."""
LEAST_SECTORS, SECTORS = 8, 16
"""Sectors in which the circle must be seen, of all: an arc of half a turn fixes its middle."""


def centre_on_boundary(
    surface: MembraneShape,
    image: Float32Array,
    camera: CameraModel,
    plane: TopPlane,
    stack: LayerStack,
) -> tuple[MembraneShape, QualityTable]:
    """Return a surface with its axis in the middle of the boundary's circle.

    Parameters
    ----------
    surface : MembraneShape
        The membrane, with its axis anywhere.
    image : (height, width, 3) float32
        Raw background, linear light.
    camera, plane, stack
        Optics.

    Returns
    -------
    surface : MembraneShape
        Where the circle is not seen, as it was.
    quality : QualityTable
        The diameter of the circle against the stated one.
    """
    lit = np.asarray(image.max(axis=2) > LEAST_LIGHT, np.uint8)
    outlines, _ = cv2.findContours(lit, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    pixels = max(outlines, key=len)[:, 0].astype(np.float64) if outlines else np.zeros((0, 2))
    max_px = np.array([camera.width - 1, camera.height - 1])
    inside = ((pixels >= BORDER_PX) & (pixels <= max_px - BORDER_PX)).all(axis=1)
    points, _ = camera_to_membrane(camera.directions(pixels[inside]), plane, stack)
    angles_rad = np.arctan2(*(points - points.mean(axis=0)).T) if len(points) else np.zeros(0)
    sectors = np.unique(np.floor(SECTORS * (angles_rad / (2.0 * np.pi) + 0.5)))
    stated_mm, measured_mm = surface.diameter_mm, np.nan
    if len(sectors) >= LEAST_SECTORS:
        pitch = paraxial_footprint_mm(camera, stack)
        start = np.array([*points.mean(axis=0), 0.5 * stated_mm])
        x, y, radius = robust_fit(circle_errors(points), start, pitch).tolist()
        surface = replace(surface, axis_mm=(x, y))
        # The outline runs through the outermost lit pixels.
        measured_mm = 2.0 * radius + pitch
    figure = judge(
        "boundary_diameter_percent",
        "Diameter of the boundary's circle against the stated one",
        100.0 * abs(measured_mm / stated_mm - 1.0),
        "%",
        warn=1.0,
        fail=5.0,
        remedy="Check the working diameter, and that the whole membrane is lit",
    )
    return surface, QualityTable((figure,) if np.isfinite(measured_mm) else ())
