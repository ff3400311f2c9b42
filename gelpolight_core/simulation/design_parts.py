"""The parts of a sensor design: camera, layers, LEDs, membrane, photometry, and pressed objects.

Lengths are in mm in the sensor frame: origin on the undeformed top surface below the camera's
optical centre, x to the right, y down, z away from the camera; heights are measured from the top
surface towards the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.limits import OneOf, Span

Shift = Annotated[float, Span(-500.0, 500.0)]
Unit = Annotated[float, Span(-1.0, 1.0)]
Centre = Annotated[float, Span(-50.0, 50.0)]
Mix = Annotated[float, Span(-1.0, 10.0)]
PerMm = Annotated[float, Span(0.0, 1.0)]


@dataclass(frozen=True, slots=True)
class CameraDesign:
    """The camera, with pixel centres at integer coordinates.

    Attributes
    ----------
    width_px, height_px : int
        Image size.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels.
    distortion : (k1, k2, p1, p2)
        Brown-Conrady, OpenCV's order.
    blur_sigma_px : float
        Standard deviation of the Gaussian blur of lens and image sensor.
    shot_variance : float
        Variance of the noise per unit of signal (signal 0..1).
    read_sd : float
        Standard deviation of the noise in the dark (signal 0..1).
    bit_depth : int
        8 or 16.
    response : str
        How light becomes pixel values: "linear", "srgb" (IEC 61966-2-1) or "gamma".
    gamma : float
        For the response "gamma": pixel values are light to the power 1 / gamma.
    """

    width_px: Annotated[int, Span(16, 16384)] = 1280
    height_px: Annotated[int, Span(16, 16384)] = 960
    fx: Annotated[float, Span(1.0, 1e5)] = 1385.6
    fy: Annotated[float, Span(1.0, 1e5)] = 1385.6
    cx: Annotated[float, Span(-1e5, 1e5)] = 634.1
    cy: Annotated[float, Span(-1e5, 1e5)] = 483.8
    distortion: tuple[Unit, Unit, Unit, Unit] = (-0.08, 0.03, 8e-4, -6e-4)
    blur_sigma_px: Annotated[float, Span(0.0, 20.0)] = 0.5
    shot_variance: Annotated[float, Span(0.0, 0.1)] = 4e-5
    read_sd: Annotated[float, Span(0.0, 0.5)] = 0.0015
    bit_depth: Annotated[int, OneOf(8, 16)] = 8
    response: Annotated[str, OneOf("linear", "srgb", "gamma")] = "linear"
    gamma: Annotated[float, Span(0.2, 5.0)] = 2.2


@dataclass(frozen=True, slots=True)
class LayerDesign:
    """The flat layers and their pose relative to the camera.

    Attributes
    ----------
    top_distance_mm : float
        Perpendicular distance from the optical centre to the top surface.
    tilt_deg, tilt_azimuth_deg : float
        Angle between the normal of the layers and the optical axis, and the image direction (from x
        to y) in which the normal is tilted.
    elastomer_thickness_mm, window_thickness_mm : float
        A window thickness of 0 means no window.
    elastomer_refractive_index, window_refractive_index : float
        For visible light.
    elastomer_absorption_per_mm : (red, green, blue)
        Of the light of each LED: exp(-absorption * path) is left after a path in the elastomer
        (Beer and Lambert). Window and air absorb nothing, also where an LED is below the elastomer.
    """

    top_distance_mm: Annotated[float, Span(1.0, 1000.0)] = 39.0
    tilt_deg: Annotated[float, Span(0.0, 20.0)] = 0.8
    tilt_azimuth_deg: Annotated[float, Span(-360.0, 360.0)] = -55.0
    elastomer_thickness_mm: Annotated[float, Span(0.1, 500.0)] = 14.0
    elastomer_refractive_index: Annotated[float, Span(1.0, 2.5)] = 1.41
    window_thickness_mm: Annotated[float, Span(0.0, 100.0)] = 2.0
    window_refractive_index: Annotated[float, Span(1.0, 2.5)] = 1.49
    elastomer_absorption_per_mm: tuple[PerMm, PerMm, PerMm] = (0.0, 0.0, 0.0)

    @property
    def normal_camera(self) -> Float64Array:
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
    """One LED: position, power, and the tilt of its axis.

    Attributes
    ----------
    x_mm, y_mm : float
        Position, sensor frame.
    height_mm : float
        Distance of the emitting disc below the top surface.
    power : float
        Relative radiant power.
    axis_tilt : (x, y)
        Slopes of its axis against the normal of the layers: the axis is along (x, y, 1).
    """

    x_mm: Shift = 0.0
    y_mm: Shift = 0.0
    height_mm: Annotated[float, Span(0.01, 500.0)] = 13.7
    power: Annotated[float, Span(0.0, 100.0)] = 1.0
    axis_tilt: tuple[Unit, Unit] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LedRing:
    """Common properties of the three LEDs.

    Attributes
    ----------
    nominal_height_mm : float
        Nominal value from the housing, as stated in session.toml.
    nominal_half_angle_deg : float or None
        Nominal value from the LED's data sheet, as stated in session.toml; None: not stated.
    lobe_exponent : float
        Radiant intensity is cos^exponent of the angle to the LED's axis (1: Lambertian, the "120
        degree" LED).
    disc_diameter_mm : float
        Diameter of the emitting disc.
    body_diameter_mm : float
        Diameter of the circle around the LED's body and solder, which blocks the view.
    """

    nominal_height_mm: Annotated[float, Span(0.01, 500.0)] = 13.7
    nominal_half_angle_deg: Annotated[float, Span(10.0, 85.0)] | None = None
    lobe_exponent: Annotated[float, Span(0.0, 100.0)] = 1.0
    disc_diameter_mm: Annotated[float, Span(0.0, 20.0)] = 0.2
    body_diameter_mm: Annotated[float, Span(0.0, 50.0)] = 0.7


@dataclass(frozen=True, slots=True)
class MembraneDesign:
    """The reflective membrane: a diffuse base with a rough metallic component.

    Attributes
    ----------
    working_diameter_mm : float
        Diameter of the coated and visible circle.
    axis_mm : (x, y)
        Centre of that circle.
    apex_height_mm : float
        Height of the undeformed membrane on its axis, a spherical cap over that circle, away from
        the camera; 0: flat. At most a third of the diameter.
    diffuse_reflectance : float
        Reflectance of the diffuse component.
    specular_weight : float
        Share of the metallic lobe, 0..1; 0 is a Lambertian membrane.
    specular_reflectance : float
        Reflectance of the metallic component at normal incidence.
    roughness : float
        Width parameter (alpha) of the metallic lobe, a GGX distribution of facets.
    stretch_loss : float
        Share of the reflectance that is lost where stretch doubles the area of the coating.
    variation : float
        Standard deviation of the reflectance factor's smooth variation.
    variation_scale_mm : float
        Length over which it varies.
    speck_count : int
        Number of dark and bright specks.
    decay_length_mm : float
        Decay length of the pressed membrane outside the contact (lambda of the elastic foundation).
    bounces : int
        Largest number of reflections between parts of the membrane; 0 for direct light only.
    """

    working_diameter_mm: Annotated[float, Span(0.5, 500.0)] = 26.0
    axis_mm: tuple[Centre, Centre] = (0.0, 0.0)
    apex_height_mm: Annotated[float, Span(0.0, 500.0)] = 0.0
    diffuse_reflectance: Annotated[float, Span(0.0, 1.0)] = 0.8
    specular_weight: Annotated[float, Span(0.0, 1.0)] = 0.3
    specular_reflectance: Annotated[float, Span(0.0, 1.0)] = 0.73
    roughness: Annotated[float, Span(0.05, 1.0)] = 0.5
    stretch_loss: Annotated[float, Span(0.0, 1.0)] = 0.0
    variation: Annotated[float, Span(0.0, 0.3)] = 0.03
    variation_scale_mm: Annotated[float, Span(0.1, 100.0)] = 3.0
    speck_count: Annotated[int, Span(0, 10000)] = 30
    decay_length_mm: Annotated[float, Span(0.05, 20.0)] = 0.7
    bounces: Annotated[int, Span(0, 64)] = 0

    @property
    def curvature_per_mm(self) -> float:
        """1 / radius of the cap's sphere, 0 if the membrane is flat."""
        square = 0.25 * self.working_diameter_mm**2 + self.apex_height_mm**2
        return 2.0 * self.apex_height_mm / square

    def height_mm(self, radius_mm: Float64Array) -> Float64Array:
        """Return the height of the undeformed membrane over the plane of its boundary.

        Parameters
        ----------
        radius_mm : (...)
            Distance from its axis; the sphere goes on below that plane.
        """
        bent = np.square(self.curvature_per_mm * radius_mm)
        fall = self.curvature_per_mm * np.square(radius_mm)
        return np.asarray(self.apex_height_mm - fall / (1.0 + np.sqrt(np.maximum(1.0 - bent, 0.0))))


@dataclass(frozen=True, slots=True)
class PhotometryDesign:
    """Exposure of the session.

    Attributes
    ----------
    whiteboard_reflectance : float
        Reflectance of the Lambertian standard.
    whiteboard_peak : float
        Brightest value of the whiteboard image without noise; above 1 it saturates.
    mirror_peak : float
        The same for an LED's disc in the mirror image, which has its own exposure.
    crosstalk : 3 x 3
        Row: channel of the camera, column: LED.
    """

    whiteboard_reflectance: Annotated[float, Span(0.01, 1.0)] = 0.9
    whiteboard_peak: Annotated[float, Span(0.01, 100.0)] = 0.94
    mirror_peak: Annotated[float, Span(0.01, 100.0)] = 0.9
    crosstalk: tuple[tuple[Mix, Mix, Mix], tuple[Mix, Mix, Mix], tuple[Mix, Mix, Mix]] = (
        (1.0, 0.04, 0.02),
        (0.05, 1.0, 0.05),
        (0.02, 0.04, 1.0),
    )


@dataclass(frozen=True, slots=True)
class SessionDesign:
    """Optional stages of a simulated session.

    Attributes
    ----------
    declares_response : bool
        Whether session.toml declares a response that is not linear.
    response_pictures : int
        Images of the whiteboard at different exposures, from 1/32 to twice its own; 0 for none.
    single_led : bool
        Whether there are images of the whiteboard with a single LED on.
    """

    declares_response: bool = True
    response_pictures: Annotated[int, Span(0, 32)] = 0
    single_led: bool = False


@dataclass(frozen=True, slots=True)
class BallPressDesign:
    """One ball of the calibration session, with its lowest point at `depth_mm`."""

    radius_mm: Annotated[float, Span(0.05, 100.0)] = 3.0
    depth_mm: Annotated[float, Span(0.0, 50.0)] = 1.0
    x_mm: Shift = 0.0
    y_mm: Shift = 0.0


@dataclass(frozen=True, slots=True)
class PressDesign:
    """One object to press: a cylinder (size: diameter), a cuboid (side), a coin or a nut.

    Attributes
    ----------
    shape : str
        One of "cylinder", "cuboid", "coin", "nut".
    size_mm : float
        Diameter, side, coin diameter, or the nut's width across flats.
    depth_mm : float
        Depth of its front face.
    x_mm, y_mm, yaw_deg : float
        Position and rotation.
    edge_radius_mm : float
        Rounding of the edge of a cylinder or cuboid.
    """

    shape: Annotated[str, OneOf("cylinder", "cuboid", "coin", "nut")] = "cylinder"
    size_mm: Annotated[float, Span(0.05, 200.0)] = 5.0
    depth_mm: Annotated[float, Span(0.0, 50.0)] = 1.0
    x_mm: Shift = 0.0
    y_mm: Shift = 0.0
    yaw_deg: Annotated[float, Span(-360.0, 360.0)] = 0.0
    edge_radius_mm: Annotated[float, Span(0.0, 5.0)] = 0.05
