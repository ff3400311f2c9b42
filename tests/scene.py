"""A small sensor whose images are shaded from the formula, for tests of single stages.

It has no refraction to speak of and no noise unless asked; the virtual sensor is the physical one.
"""

from dataclasses import replace

import numpy as np

from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.light.directions import light_directions
from gelpolight_core.light.membrane_brdf import CURVE_NODES, MembraneBrdf
from gelpolight_core.light.reflectance_table import cosine_table
from gelpolight_core.sensor.sensor_calibration import (
    Calibration,
    FullModel,
    OpenSensor,
    Provenance,
    ScaleUncertainty,
    sensor_stack,
)
from gelpolight_core.session.session import SensorData

CAMERA = CameraModel(320, 240, 345.0, 345.0, 161.3, 118.2, (-0.05, 0.01, 0.0005, -0.0003, 0.0))
PLANE = TopPlane((0.0, 0.0, 1.0), 39.0)
SENSOR = SensorData("T-1", 13.7, 14.0, 1.41, 0.0, 1.49, 22.0)
LEDS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.7], [10.1, -6.3, -13.7]])


def table() -> ResamplingTable:
    """Return the resampling table of the small sensor."""
    return build_resampling_table(
        CAMERA, PLANE, sensor_stack(SENSOR, PLANE), working_diameter_mm=SENSOR.working_diameter_mm
    )


def flat_light(points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (cosines, radiance) of Lambertian LEDs on the flat membrane, brightest about 0.8."""
    at_top = np.concatenate([points_mm, np.zeros_like(points_mm[..., :1])], axis=-1)
    light, distance = light_directions(LEDS, at_top)
    cosines = -light[..., 2]
    return cosines, 150.0 * cosines / distance**2


def calibration() -> Calibration:
    """Return a perfect calibration for a membrane that is Lambertian and even."""
    grid_table = table()
    _, radiance = flat_light(grid_table.grid.points_mm())
    shown = np.where(grid_table.valid[..., None], radiance, 0.0).astype(np.float32)
    data = OpenSensor(
        sensor=SENSOR,
        camera=CAMERA,
        plane=PLANE,
        led_positions_mm=LEDS,
        led_covariance_mm2=np.tile(0.01 * np.eye(3), (3, 1, 1)),
        crosstalk=np.eye(3),
        radiance=shown,
        factors=np.where(shown > 0, 1.0, 0.0).astype(np.float32),
        reflectance=cosine_table(),
        noise=np.full(3, 0.002),
    )
    quality = {"lens": QualityTable((judge("rms", "Error", 0.05, "px", warn=0.3),))}
    made = Provenance("2026-01-02T03:04:05+00:00", "someone", "0.1.0", "s", {"a": "b"})
    return Calibration("paper", data, quality, made)


CURVES = tuple(tuple((np.linspace(0.0, 1.0, CURVE_NODES) ** n).tolist()) for n in (1.0, 1.1, 0.9))


def full_calibration(membrane: MembraneBrdf | None = None) -> Calibration:
    """Return the same with a full model of unusual numbers, also in what is optional."""
    plain = calibration()
    full = FullModel(
        led_positions_mm=plain.data.led_positions_mm + np.array([0.1, -0.03, -0.2]),
        led_sd_mm=np.array([[0.01, 0.02, 0.05], [0.015, 0.01, 0.04], [0.01, 0.01, 0.06]]),
        membrane=membrane or MembraneBrdf(1.03, 0.21, 0.47, 0.31, CURVES),
        background=(0.9 * plain.data.radiance).astype(np.float32),
        decay_mm=0.68,
        misfit=0.0123,
        kept="refined",
        membrane_sd={"decay_mm": 0.01, "gloss": 0.012},
        worth={"leds": 0.011, "lobe": 0.0004},
        scale_sd=ScaleUncertainty(depth=0.0061, lateral=0.0002),
    )
    return replace(plain, model="full").changed(full=full)


def failed(cal: Calibration) -> Calibration:
    """Return a calibration with a figure that failed: half a pixel where 0.3 is the limit."""
    figure = judge("rms", "Half a pixel", 0.5, "px", fail=0.3)
    return replace(cal, quality={**cal.quality, "lens": QualityTable((figure,))})


def raw_image(slopes: np.ndarray, cal: Calibration) -> np.ndarray:
    """Return the raw image (height, width, 3) of a membrane with given slopes, lights frozen.

    Parameters
    ----------
    slopes : function of points (..., 2) to (..., 2)
        d(depth)/dx and d(depth)/dy.
    cal : Calibration
        Of the small sensor.
    """
    from gelpolight_core.geometry.refraction import camera_to_membrane

    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].astype(float)
    points, _ = camera_to_membrane(
        CAMERA.directions(np.stack([u, v], axis=-1)), PLANE, cal.data.stack
    )
    _, radiance = flat_light(points)
    at_top = np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)
    light, _ = light_directions(LEDS, at_top)
    slope = slopes(points)  # type: ignore[operator]
    normal = np.concatenate([-slope, -np.ones_like(slope[..., :1])], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    cosine = np.clip(np.einsum("...kc,...c->...k", light, normal), 0.0, None)
    return np.asarray(radiance * cosine, np.float32)
