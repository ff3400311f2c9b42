"""The parts of a sensor design: camera, layers, LEDs, membrane, photometry, what is pressed.

Lengths in mm in the sensor frame: origin on the undeformed top surface below the camera's optical
centre, x to the right, y down, z from the camera outward; heights are measured from the top
surface towards the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHAPES = ("cylinder", "cuboid", "coin", "nut")
RESPONSES = ("linear", "srgb", "gamma")


def _within(default: Any, low: float, high: float) -> Any:
    """Return a dataclass field whose numbers must lie in [low, high]."""
    return field(default=default, metadata={"low": low, "high": high})


@dataclass(frozen=True, slots=True)
class CameraDesign:
    """The camera; pixel centres at whole numbers.

    Attributes
    ----------
    width_px, height_px : int
        Picture size.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels.
    distortion : (k1, k2, p1, p2)
        Brown-Conrady, OpenCV's order.
    blur_sigma_px : float
        Standard deviation of the lens's and the sensor's Gaussian blur.
    shot_variance : float
        Variance of the noise per unit of signal (signal 0..1).
    read_sd : float
        Standard deviation of the noise in the dark (signal 0..1).
    bit_depth : int
        8 or 16.
    response : str
        How light becomes the camera's numbers: "linear", "srgb" (IEC 61966-2-1) or "gamma".
    gamma : float
        Of the response "gamma": numbers go as light to the power 1 / gamma.
    """

    width_px: int = _within(1280, 16, 16384)
    height_px: int = _within(960, 16, 16384)
    fx: float = _within(1385.6, 1.0, 1e5)
    fy: float = _within(1385.6, 1.0, 1e5)
    cx: float = _within(634.1, -1e5, 1e5)
    cy: float = _within(483.8, -1e5, 1e5)
    distortion: tuple[float, float, float, float] = _within((-0.08, 0.03, 8e-4, -6e-4), -1.0, 1.0)
    blur_sigma_px: float = _within(0.5, 0.0, 20.0)
    shot_variance: float = _within(4e-5, 0.0, 0.1)
    read_sd: float = _within(0.0015, 0.0, 0.5)
    bit_depth: int = _within(8, 8, 16)
    response: str = "linear"
    gamma: float = _within(2.2, 0.2, 5.0)


@dataclass(frozen=True, slots=True)
class LayerDesign:
    """The flat layers and how they stand before the camera.

    Attributes
    ----------
    top_distance_mm : float
        Perpendicular distance from the optical centre to the top surface.
    tilt_deg, tilt_azimuth_deg : float
        Angle between the layers' normal and the optical axis, and the picture direction (from x to
        y) into which the normal leans.
    elastomer_thickness_mm, window_thickness_mm : float
        Window 0: none.
    elastomer_refractive_index, window_refractive_index : float
        For visible light.
    """

    top_distance_mm: float = _within(39.0, 1.0, 1000.0)
    tilt_deg: float = _within(0.8, 0.0, 20.0)
    tilt_azimuth_deg: float = _within(-55.0, -360.0, 360.0)
    elastomer_thickness_mm: float = _within(14.0, 0.1, 500.0)
    elastomer_refractive_index: float = _within(1.41, 1.0, 2.5)
    window_thickness_mm: float = _within(2.0, 0.0, 100.0)
    window_refractive_index: float = _within(1.49, 1.0, 2.5)

    @property
    def normal_camera(self) -> Array:
        """(3,) unit normal of the layers in the camera frame, pointing outward."""
        tilt, azimuth = math.radians(self.tilt_deg), math.radians(self.tilt_azimuth_deg)
        return np.array(
            [
                math.sin(tilt) * math.cos(azimuth),
                math.sin(tilt) * math.sin(azimuth),
                math.cos(tilt),
            ]
        )

    @property
    def air_gap_mm(self) -> float:
        """Distance from the optical centre to the lowest face, along the normal."""
        return self.top_distance_mm - self.elastomer_thickness_mm - self.window_thickness_mm


@dataclass(frozen=True, slots=True)
class LedDesign:
    """One LED: where it is, and how strong.

    Attributes
    ----------
    x_mm, y_mm : float
        Sensor frame.
    height_mm : float
        Of the emitting disc below the top surface.
    power : float
        Relative radiant power.
    """

    x_mm: float = _within(0.0, -500.0, 500.0)
    y_mm: float = _within(0.0, -500.0, 500.0)
    height_mm: float = _within(13.7, 0.01, 500.0)
    power: float = _within(1.0, 0.0, 100.0)


@dataclass(frozen=True, slots=True)
class LedRing:
    """What the three LEDs have in common.

    Attributes
    ----------
    nominal_height_mm : float
        The housing's nominal value, as session.toml states it.
    lobe_exponent : float
        Radiant intensity goes as cos^exponent of the angle to the upward normal (1: Lambertian,
        the "120 degree" LED).
    disc_diameter_mm : float
        Diameter of the emitting disc.
    body_diameter_mm : float
        Diameter of the circle that holds the LED's body and solder, which blocks the view.
    """

    nominal_height_mm: float = _within(13.7, 0.01, 500.0)
    lobe_exponent: float = _within(1.0, 0.0, 100.0)
    disc_diameter_mm: float = _within(0.2, 0.0, 20.0)
    body_diameter_mm: float = _within(0.7, 0.0, 50.0)


@dataclass(frozen=True, slots=True)
class MembraneDesign:
    """The reflective membrane: a diffuse base with a rough metallic share.

    Attributes
    ----------
    working_diameter_mm : float
        Of the circle that is coated and seen.
    diffuse_reflectance : float
        Of the diffuse share.
    specular_weight : float
        Share of the metallic lobe, 0..1; 0 is a Lambertian membrane.
    specular_reflectance : float
        Of the metallic share at normal incidence.
    roughness : float
        Width parameter (alpha) of the metallic lobe, a GGX distribution of facets.
    variation : float
        Standard deviation of the reflectance factor's smooth variation.
    variation_scale_mm : float
        Length over which it varies.
    speck_count : int
        Number of dark and bright specks.
    decay_length_mm : float
        Over which the pressed membrane rises outside the contact (lambda of the elastic
        foundation).
    """

    working_diameter_mm: float = _within(26.0, 0.5, 500.0)
    diffuse_reflectance: float = _within(0.8, 0.0, 1.0)
    specular_weight: float = _within(0.3, 0.0, 1.0)
    specular_reflectance: float = _within(0.73, 0.0, 1.0)
    roughness: float = _within(0.5, 0.05, 1.0)
    variation: float = _within(0.03, 0.0, 0.3)
    variation_scale_mm: float = _within(3.0, 0.1, 100.0)
    speck_count: int = _within(30, 0, 10000)
    decay_length_mm: float = _within(0.7, 0.05, 20.0)


@dataclass(frozen=True, slots=True)
class PhotometryDesign:
    """How the session is exposed.

    Attributes
    ----------
    whiteboard_reflectance : float
        Of the Lambertian standard.
    whiteboard_peak : float
        The brightest value of the whiteboard's picture without noise; above 1 it saturates.
    mirror_peak : float
        The same for an LED's disc in the mirror picture, which is exposed for itself.
    crosstalk : 3 x 3
        Row: channel of the camera, column: LED.
    """

    whiteboard_reflectance: float = _within(0.9, 0.01, 1.0)
    whiteboard_peak: float = _within(0.94, 0.01, 100.0)
    mirror_peak: float = _within(0.9, 0.01, 100.0)
    crosstalk: tuple[
        tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]
    ] = _within(((1.0, 0.04, 0.02), (0.05, 1.0, 0.05), (0.02, 0.04, 1.0)), -1.0, 10.0)


@dataclass(frozen=True, slots=True)
class SessionDesign:
    """What a simulated session holds beside the stages that every session has.

    Attributes
    ----------
    declares_response : bool
        Whether session.toml declares a response that is not linear.
    response_pictures : int
        Pictures of the whiteboard at different exposures, from 1/32 to twice its own; 0: none.
    single_led : bool
        Whether there are pictures of the whiteboard with one LED lit.
    """

    declares_response: bool = True
    response_pictures: int = _within(0, 0, 32)
    single_led: bool = False


@dataclass(frozen=True, slots=True)
class BallPress:
    """One ball of the calibration session; `depth_mm` is how deep its lowest point goes."""

    radius_mm: float = _within(3.0, 0.05, 100.0)
    depth_mm: float = _within(1.0, 0.0, 50.0)
    x_mm: float = _within(0.0, -500.0, 500.0)
    y_mm: float = _within(0.0, -500.0, 500.0)


@dataclass(frozen=True, slots=True)
class Press:
    """One object to press: a cylinder (size: diameter), a cuboid (side), a coin or a nut.

    Attributes
    ----------
    shape : str
        One of "cylinder", "cuboid", "coin", "nut".
    size_mm : float
        Diameter, side, coin diameter, or the nut's width across flats.
    depth_mm : float
        How deep its foremost face goes.
    x_mm, y_mm, yaw_deg : float
        Where it is pressed and how it is turned.
    edge_radius_mm : float
        Rounding of the edge of a cylinder or cuboid.
    """

    shape: str = "cylinder"
    size_mm: float = _within(5.0, 0.05, 200.0)
    depth_mm: float = _within(1.0, 0.0, 50.0)
    x_mm: float = _within(0.0, -500.0, 500.0)
    y_mm: float = _within(0.0, -500.0, 500.0)
    yaw_deg: float = _within(0.0, -360.0, 360.0)
    edge_radius_mm: float = _within(0.05, 0.0, 5.0)
