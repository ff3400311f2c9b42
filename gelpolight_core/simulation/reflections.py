"""Mirror images of the LEDs in the flat faces, as the camera would see them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .design_parts import LedDesign
from .rays import (
    camera_points,
    pixel_directions,
    project_through_layers,
    project_to_pixels,
    radius_through_layers,
    reflection,
    sensor_axes,
)
from .sensor_design import SensorDesign

LED_NAMES = ("R", "G", "B")


@dataclass(frozen=True, slots=True)
class Reflection:
    """One light path by which a mirror image of an LED may be visible.

    Attributes
    ----------
    led : str
        "R", "G" or "B".
    face : str
        "lower face", "top surface" or "top surface twice".
    pixel : (u, v)
        Position in the image.
    at_mm : (x, y)
        Last point of reflection on the face, sensor frame.
    reflectance : float
        Product of the Fresnel reflectances along the path with air behind each face.
    in_image : bool
        Whether the pixel lies in the image and, for the top surface, in the working circle.
    """

    led: str
    face: str
    pixel: tuple[float, float]
    at_mm: tuple[float, float]
    reflectance: float
    in_image: bool


def led_reflections(design: SensorDesign) -> tuple[Reflection, ...]:
    """Return every mirror image of an LED that a flat face can show to the camera."""
    reflections: list[Reflection] = []
    for name, led in zip(LED_NAMES, design.leds, strict=True):
        face_mm = design.layers.elastomer_thickness_mm + design.layers.window_thickness_mm
        if led.height_mm > face_mm:
            reflections.append(_below_lower_face(design, name, led, face_mm))
        else:
            reflections.extend(_by_top_surface(design, name, led, times) for times in (1, 2))
    return tuple(reflections)


def _below_lower_face(
    design: SensorDesign, name: str, led: LedDesign, face_mm: float
) -> Reflection:
    """Return the mirror image of an LED in air below the layers (a path through air only)."""
    layers = design.layers
    twin_height = 2.0 * face_mm - led.height_mm
    pixel = project_to_pixels(
        design.camera, camera_points(layers, np.array([led.x_mm, led.y_mm, -twin_height]))
    )
    distance = layers.top_distance_mm - twin_height
    share = layers.air_gap_mm / distance
    at = (led.x_mm * share, led.y_mm * share)
    radius = math.hypot(led.x_mm, led.y_mm)
    window = layers.window_thickness_mm > 0.0
    index = layers.window_refractive_index if window else layers.elastomer_refractive_index
    strength = reflection(np.array(radius / math.hypot(radius, distance)), 1.0, index)
    u, v = pixel.tolist()
    return Reflection(name, "lower face", (u, v), at, float(strength), _in_image(design, pixel))


def _by_top_surface(design: SensorDesign, name: str, led: LedDesign, times: int) -> Reflection:
    """Return the mirror image in the top surface, with the lower face between two reflections."""
    layers = design.layers
    # Unfolded, each further reflection adds the path down and up through all layers.
    repeats = 2.0 * (times - 1)
    unfolded = replace(
        layers,
        top_distance_mm=layers.top_distance_mm
        + repeats * (layers.elastomer_thickness_mm + layers.window_thickness_mm),
        elastomer_thickness_mm=layers.elastomer_thickness_mm * (1.0 + repeats),
        window_thickness_mm=layers.window_thickness_mm * (1.0 + repeats),
    )
    twin = np.array([led.x_mm, led.y_mm, led.height_mm])
    pixel = project_through_layers(design.camera, unfolded, twin)
    sine = _sine_in_air(design, pixel)
    radius = float(radius_through_layers(layers, np.array(sine)))
    distance = max(math.hypot(led.x_mm, led.y_mm), 1e-12)
    at = (led.x_mm / distance * radius, led.y_mm / distance * radius)
    top = float(reflection(np.array(sine), layers.elastomer_refractive_index, 1.0))
    radius_mm = 0.5 * design.membrane.working_diameter_mm
    face = "top surface" if times == 1 else "top surface twice"
    visible = _in_image(design, pixel) and radius <= radius_mm
    u, v = pixel.tolist()
    return Reflection(name, face, (u, v), at, top ** (2 * times - 1), visible)


def _sine_in_air(design: SensorDesign, pixel: Float64Array) -> float:
    """Sine of the angle between a pixel's ray in air and the layers' normal."""
    direction = pixel_directions(design.camera, np.array(pixel[0]), np.array(pixel[1]))
    ray = sensor_axes(design.layers) @ direction
    return float(np.hypot(ray[0], ray[1]) / np.linalg.norm(ray))


def _in_image(design: SensorDesign, pixel: Float64Array) -> bool:
    size = np.array([design.camera.width_px, design.camera.height_px])
    return bool((pixel >= -0.5).all() and (pixel <= size - 0.5).all())
