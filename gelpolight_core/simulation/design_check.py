"""Check a sensor design before it is built (section VII of the paper, Discussions).

Light of an LED can reach the camera without carrying information about the membrane: reflected at
the outer lower face when the LED is below it, reflected at the top surface where the membrane is
glossy or an air film remains, or reflected there twice with a reflection at the lower face in
between. In addition, the three light directions must differ enough everywhere, the LEDs must not
hide the membrane, and no part of it may be too dark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.finding import Finding, QualityTable, judge

from .lamps import PointLamp, lamp_table, lamps_of
from .rays import RayTable, project_through_layers, reflection, trace_pixels
from .reflections import LED_NAMES, Reflection, led_reflections
from .sensor_design import SensorDesign, validate_design
from .shading import SurfaceMaterial, flat_brightness, point_brightness

CONDITION_WARN, CONDITION_FAIL = 6.0, 20.0
"""The smallest singular value of three unit directions is at least 1 / condition, so 1 % of noise
becomes up to 1 % * condition of a normal: 3 degrees at 6, 11 degrees at 20. Good sensors have 3 to
4."""

GLOSS_WARN, GLOSS_FAIL = 0.6, 0.9
"""Above about a half, the brightness depends more on the viewing direction than on the angle to the
light, but the reflectance function describes only the latter."""

EVEN_WARN, EVEN_FAIL = 10.0 / 240.0, 4.0 / 240.0
"""With the brightest point at level 240 of 255, the darkest has 10, or 4, levels: one step of an
8-bit camera is then a tenth, or a quarter, of the signal."""

VEIL_WARN, VEIL_FAIL = 0.05, 0.2
"""Light reflected by the lower face brightens shadows; a fit of one light per channel reads a veil
of 5 % as a slope of 3 degrees."""


@dataclass(frozen=True, slots=True)
class DesignCheckResult:
    """Figures of a sensor design, judged before it is built.

    Attributes
    ----------
    quality : QualityTable
        Figures with verdicts and advice.
    reflections : tuple of Reflection
        All mirror images of LEDs, visible or not.
    """

    quality: QualityTable
    reflections: tuple[Reflection, ...]


def check_design(design: SensorDesign) -> DesignCheckResult:
    """Judge a design: mirror images of LEDs, light directions, hidden pixels, evenness.

    Parameters
    ----------
    design : SensorDesign
        The sensor.

    Returns
    -------
    DesignCheckResult

    Raises
    ------
    InputError
        If the parts of the design do not fit together.
    """
    validate_design(design)
    radius_mm = 0.5 * design.membrane.working_diameter_mm
    cells = np.linspace(-radius_mm, radius_mm, 81)
    x, y = np.meshgrid(cells, cells)
    outside = np.hypot(x, y) > radius_mm
    condition = light_condition(design, x, y)
    condition[outside] = np.nan
    irradiance = flat_irradiance(design, x, y)
    irradiance[outside] = np.nan
    irradiance /= np.maximum(np.nanmax(irradiance, axis=(0, 1)), 1e-300)
    reflections = led_reflections(design)
    figures = (
        _lower_face_figure(reflections),
        _gloss_figure(design, reflections),
        _bare_figure(reflections),
        _embedding_figure(design),
        _condition_figure(float(np.nanmax(condition))),
        _blocked_figure(blocked_pixels(design)[1]),
        *_evenness_figures(irradiance),
        _veil_figure(design),
    )
    return DesignCheckResult(QualityTable(figures), reflections)


def light_condition(design: SensorDesign, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the condition number of the light directions (Eq. 10) on the flat membrane.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    x_mm, y_mm : (...)
        Points, sensor frame.
    """
    lights = np.stack(
        [
            np.stack([led.x_mm - x_mm, led.y_mm - y_mm, np.full_like(x_mm, -led.height_mm)], -1)
            for led in design.leds
        ],
        axis=-2,
    )
    lights /= np.linalg.norm(lights, axis=-1, keepdims=True)
    sizes = np.linalg.svd(lights, compute_uv=False)
    return np.asarray(sizes[..., 0] / np.maximum(sizes[..., -1], 1e-12))


def flat_irradiance(design: SensorDesign, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return (..., 3): irradiance of each LED on the flat membrane.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    x_mm, y_mm : (...)
        Points, sensor frame.
    """
    x, y = np.atleast_2d(x_mm, y_mm)
    straight, white = np.zeros_like(x), SurfaceMaterial(1.0)
    rays = RayTable(x, y, straight, straight, np.ones_like(x))
    light = flat_brightness(rays, lamp_table(lamps_of(design)), white)
    return light.reshape(*np.shape(x_mm), -1)


def blocked_pixels(design: SensorDesign) -> tuple[BoolArray, float]:
    """Return the pixels in which an LED's body hides the membrane, and their share of it.

    Parameters
    ----------
    design : SensorDesign
        The sensor; a body is a disc of the ring's `body_diameter_mm`.

    Returns
    -------
    blocked : (rows, columns) bool
    share : float
        Share of the pixels that show the working circle.
    """
    camera = design.camera
    rays = trace_pixels(camera, design.layers)
    working = np.hypot(rays.x_mm, rays.y_mm) <= 0.5 * design.membrane.working_diameter_mm
    angle = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    radius = 0.5 * design.ring.body_diameter_mm
    body = np.zeros((camera.height_px, camera.width_px), dtype=np.uint8)
    for led in design.leds:
        outline = np.stack(
            [
                led.x_mm + radius * np.cos(angle),
                led.y_mm + radius * np.sin(angle),
                np.full_like(angle, -led.height_mm),
            ],
            axis=-1,
        )
        pixels = project_through_layers(camera, design.layers, outline)
        cv2.fillPoly(body, [np.rint(pixels).astype(np.int32)], 1)
    blocked = (body > 0) & working
    return blocked, float(blocked.sum() / max(int(working.sum()), 1))


def veil_share(design: SensorDesign) -> float:
    """Return the largest share of light that arrives via the outer lower face.

    One reflection from the flat diffuse membrane to the face and back (Fresnel, total reflection
    past the critical angle); the window counts as elastomer that absorbs nothing.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    """
    layers, radius_mm = design.layers, 0.5 * design.membrane.working_diameter_mm
    cells = np.linspace(-radius_mm, radius_mm, 31)
    x, y = (a[np.hypot(*np.meshgrid(cells, cells)) <= radius_mm] for a in np.meshgrid(cells, cells))
    direct = flat_irradiance(design, x, y)
    path_mm = 2.0 * (layers.elastomer_thickness_mm + layers.window_thickness_mm)
    r2 = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 + path_mm**2
    cosine = path_mm / np.sqrt(r2)
    invariant = layers.elastomer_refractive_index * np.sqrt(1.0 - cosine**2)
    mirrored = reflection(invariant, layers.elastomer_refractive_index, 1.0)
    area = (cells[1] - cells[0]) ** 2
    material = SurfaceMaterial.of_membrane(design.membrane)
    kernel = (material.diffuse + material.specular) * mirrored * cosine**2 / (math.pi * r2) * area
    absorbing_mm = 2.0 * layers.elastomer_thickness_mm / cosine
    returned = [
        (kernel * np.exp(-absorption * absorbing_mm)) @ direct[:, k]
        for k, absorption in enumerate(layers.elastomer_absorption_per_mm)
    ]
    lit = direct > 0.0
    return float(np.max(np.stack(returned, axis=-1)[lit] / direct[lit], initial=0.0))


def _lower_face_figure(reflections: tuple[Reflection, ...]) -> Finding:
    visible = [r for r in reflections if r.face == "lower face" and r.in_image]
    where = ", ".join(f"{r.led} ({r.pixel[0]:.0f}, {r.pixel[1]:.0f})" for r in visible)
    return judge(
        "lower_face_reflections",
        "LEDs visible as reflections in the lower face",
        float(len(visible)),
        fail=0.5,
        remedy=(
            f"Reflections reach the camera at {where}. Embed the LEDs in the elastomer, or "
            "move them outward until the reflections leave the image"
        ),
    )


def _gloss_figure(design: SensorDesign, reflections: tuple[Reflection, ...]) -> Finding:
    shares, positions = [0.0], [""]
    for number, lamp in enumerate(lamps_of(design)):
        for r in reflections:
            if r.led == LED_NAMES[number] and r.face == "top surface" and r.in_image:
                shares.append(gloss_share(design, lamp, r.at_mm))
                positions.append(f"{r.led} ({r.pixel[0]:.0f}, {r.pixel[1]:.0f})")
    worst = int(np.argmax(shares))
    return judge(
        "membrane_gloss",
        "Metallic share of the membrane brightness at an LED's reflection",
        100.0 * shares[worst],
        "%",
        warn=100.0 * GLOSS_WARN,
        fail=100.0 * GLOSS_FAIL,
        remedy=(
            f"The membrane is glossy at {positions[worst]}. Make it rougher or more diffuse, or "
            "move the LEDs outward"
        ),
    )


def gloss_share(design: SensorDesign, lamp: PointLamp, at_mm: tuple[float, float]) -> float:
    """Return the metallic share of the flat membrane's brightness at a mirror point.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    lamp : PointLamp
        Whose mirror point it is.
    at_mm : (float, float)
        That point (x, y) on the membrane.
    """
    material = SurfaceMaterial.of_membrane(design.membrane)
    if material.specular <= 0.0:
        return 0.0
    to_lamp = np.array([lamp.x_mm - at_mm[0], lamp.y_mm - at_mm[1], -lamp.height_mm])
    to_lamp /= np.linalg.norm(to_lamp)
    # At its mirror point, the light leaves towards the camera at the angle of incidence.
    view = (-to_lamp[0], -to_lamp[1], to_lamp[2])
    point, normal = (at_mm[0], at_mm[1], 0.0), (0.0, 0.0, -1.0)
    row = np.array(lamp.row())
    whole = point_brightness(point, normal, view, row, material.values)
    matt = SurfaceMaterial(material.diffuse).values
    dull = point_brightness(point, normal, view, row, matt)
    return 1.0 - dull / whole if whole > 0.0 else 0.0


def _bare_figure(reflections: tuple[Reflection, ...]) -> Finding:
    visible = [r for r in reflections if r.face != "lower face" and r.in_image]
    return judge(
        "air_film_images",
        "LED reflections that an air film under the whiteboard would show",
        float(len(visible)),
    )


def _embedding_figure(design: SensorDesign) -> Finding:
    deepest = max(led.height_mm for led in design.leds)
    return judge(
        "led_outside_elastomer",
        "Height of the lowest LED below the elastomer",
        max(0.0, deepest - design.layers.elastomer_thickness_mm),
        "mm",
        warn=0.0,
        remedy=(
            "Light from there is refracted before it reaches the membrane, which the calibration "
            "does not model. Embed the LEDs in the elastomer"
        ),
    )


def _condition_figure(worst: float) -> Finding:
    return judge(
        "light_condition",
        "Condition number of the light directions, largest",
        worst,
        warn=CONDITION_WARN,
        fail=CONDITION_FAIL,
        remedy=(
            "Move the LEDs further apart (120 degrees about the axis) or nearer to the top surface"
        ),
    )


def _blocked_figure(share: float) -> Finding:
    return judge(
        "blocked_share",
        "Membrane hidden by the LEDs",
        100.0 * share,
        "%",
        warn=0.0,
        fail=1.0,
        remedy="Move the LEDs outward, use smaller ones, or reduce the working diameter",
    )


def _evenness_figures(irradiance: Float64Array) -> tuple[Finding, ...]:
    return tuple(
        judge(
            f"evenness_{name.lower()}",
            f"Ratio of darkest to brightest point, {name}",
            100.0 * float(np.nanmin(irradiance[..., k])),
            "%",
            warn=100.0 * EVEN_WARN,
            fail=100.0 * EVEN_FAIL,
            higher_is_better=True,
            remedy="Lower the LEDs below the top surface, or use a camera with more bits",
        )
        for k, name in enumerate(LED_NAMES)
    )


def _veil_figure(design: SensorDesign) -> Finding:
    return judge(
        "lower_face_veil",
        "Light on the membrane via the lower face, largest share",
        100.0 * veil_share(design),
        "%",
        warn=100.0 * VEIL_WARN,
        fail=100.0 * VEIL_FAIL,
        remedy="Make the elastomer thicker, or the membrane darker or smaller",
    )
