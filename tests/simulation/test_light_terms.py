"""The terms of a real sensor's light in the virtual sensor compared with closed formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.simulation.design_check import check_design, flat_irradiance, veil_share
from gelpolight_core.simulation.design_parts import CameraDesign, LayerDesign, MembraneDesign
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    PressedMembrane,
    SensorState,
    VirtualSensor,
    Whiteboard,
)

ABSORPTION = (0.004, 0.05, 0.009)
TILTS = ((0.08, -0.03), (-0.4, 0.3), (0.0, 0.0))
PLAIN = MembraneDesign(specular_weight=0.0, variation=0.0, speck_count=0)


def plain_design(**changes: object) -> SensorDesign:
    """Return a sensor with a matt membrane and a noise-free camera of 160 x 120 pixels."""
    design = SensorDesign(
        camera=CameraDesign(shot_variance=0.0, read_sd=0.0, blur_sigma_px=0.0),
        layers=LayerDesign(tilt_deg=0.0, tilt_azimuth_deg=0.0),
        membrane=PLAIN,
    )
    return replace(design, **changes).scaled(0.125)


def absorbing(design: SensorDesign) -> SensorDesign:
    """Return a design whose gel absorbs."""
    return replace(design, layers=replace(design.layers, elastomer_absorption_per_mm=ABSORPTION))


def led_light(sensor: VirtualSensor, state: SensorState) -> np.ndarray:
    """Return the light of each LED (rows, columns, 3) before exposure and crosstalk."""
    mixing = np.array(sensor.design.photometry.crosstalk)
    return sensor.brightness(state) @ np.linalg.inv(mixing).T / sensor.exposure


def ramp(slope: float, depth_mm: float = 1.0) -> PressedSurface:
    """Return a plane over 8 x 8 mm whose depth rises with x and is `depth_mm` at x = 0."""
    x = 0.02 * np.arange(-200, 201)
    depth = np.maximum(depth_mm + slope * x, 0.0) * np.ones((401, 1))
    return PressedSurface(depth, depth > 0.0, float(x[0]), float(x[0]), 0.02)


def central(sensor: VirtualSensor) -> np.ndarray:
    """Return the pixels that show points near x = y = 0."""
    return np.hypot(sensor.rays.x_mm, sensor.rays.y_mm) < 0.35


@pytest.mark.parametrize("exponent", [1.0, 1.6])
def test_the_light_of_an_led_falls_with_its_lobe_about_its_tilted_axis(exponent):
    design = plain_design()
    tilted = tuple(replace(x, axis_tilt=t) for x, t in zip(design.leds, TILTS, strict=True))
    design = replace(design, leds=tilted, ring=replace(design.ring, lobe_exponent=exponent))
    sensor = VirtualSensor(design)
    light, rays = led_light(sensor, Whiteboard()), sensor.rays
    inside = np.hypot(rays.x_mm, rays.y_mm) < 12.5
    x_mm, y_mm = rays.x_mm[inside], rays.y_mm[inside]
    checked = flat_irradiance(design, x_mm, y_mm)
    for k, (led, tilt) in enumerate(zip(design.leds, TILTS, strict=True)):
        way = np.stack([x_mm - led.x_mm, y_mm - led.y_mm, np.full_like(x_mm, led.height_mm)])
        distance_mm = np.linalg.norm(way, axis=0)
        axis = np.array([*tilt, 1.0]) / math.hypot(*tilt, 1.0)
        from_axis = np.maximum(np.tensordot(axis, way, 1) / distance_mm, 0.0)
        expected = led.power * from_axis**exponent * way[2] / distance_mm**3
        assert checked[:, k] == pytest.approx(expected, rel=1e-12)
        ratio = light[..., k][inside] / (expected * rays.transmission[inside])
        assert np.ptp(ratio) / ratio.mean() < 1e-9


@pytest.mark.parametrize("led_height_mm", [13.0, 16.0])
@pytest.mark.parametrize("state", [Whiteboard(), BareMembrane(), PressedMembrane(ramp(0.0, 2.0))])
def test_the_gel_absorbs_on_the_way_to_the_surface_and_to_the_camera(led_height_mm, state):
    """An LED at 16 mm is in the window below 14 mm of elastomer; the window absorbs nothing."""
    design = plain_design()
    design = replace(
        design, leds=tuple(replace(led, height_mm=led_height_mm) for led in design.leds)
    )
    clear, dyed = VirtualSensor(design), VirtualSensor(absorbing(design))
    depth_mm = state.surface.depth_mm.max() if isinstance(state, PressedMembrane) else 0.0
    mask, rays = central(clear), clear.rays
    passed = led_light(dyed, state)[mask] / led_light(clear, state)[mask]
    slope_x, slope_y = rays.slope_x[mask], rays.slope_y[mask]
    x_mm, y_mm = rays.x_mm[mask] - depth_mm * slope_x, rays.y_mm[mask] - depth_mm * slope_y
    to_camera_mm = (14.0 - depth_mm) * np.sqrt(1.0 + slope_x**2 + slope_y**2)
    for k, led in enumerate(design.leds):
        rise_mm = led_height_mm - depth_mm
        to_surface_mm = np.sqrt((led.x_mm - x_mm) ** 2 + (led.y_mm - y_mm) ** 2 + rise_mm**2)
        to_surface_mm *= (min(14.0, led_height_mm) - depth_mm) / rise_mm
        expected = np.exp(-ABSORPTION[k] * (to_surface_mm + to_camera_mm))
        assert passed[:, k] == pytest.approx(expected, rel=1e-6)


def test_the_gel_absorbs_at_the_brim_of_a_dome_as_over_its_middle():
    """Over the boundary of a dome, light passes the elastomer to the plane of the boundary."""
    design = plain_design(membrane=replace(PLAIN, apex_height_mm=2.0))
    clear, dyed = VirtualSensor(design), VirtualSensor(absorbing(design))
    mask, rays = central(clear), clear.rays
    passed = led_light(dyed, BareMembrane())[mask] / led_light(clear, BareMembrane())[mask]
    depth_mm = 2.0 - design.membrane.height_mm(np.hypot(rays.x_mm, rays.y_mm)[mask])
    for k, led in enumerate(design.leds):
        to_surface_mm = np.sqrt(
            (led.x_mm - rays.x_mm[mask]) ** 2
            + (led.y_mm - rays.y_mm[mask]) ** 2
            + (led.height_mm + 2.0 - depth_mm) ** 2
        )
        to_camera_mm = (16.0 - depth_mm) * np.hypot(1.0, np.hypot(rays.slope_x, rays.slope_y)[mask])
        expected = np.exp(-ABSORPTION[k] * (to_surface_mm + to_camera_mm))
        # The ray meets the dome up to 5 um below its plane, some micrometres aside.
        assert passed[:, k] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("slope", "share"),
    [
        (0.75, 1.0 - 0.12 * 0.25),
        (math.tan(math.radians(60.0)), 1.0 - 0.12),
        (math.tan(math.radians(85.0)), 0.3),
    ],
)
def test_a_stretched_coating_loses_reflectance_with_the_area_that_it_gains(slope, share):
    """A slope of 60 degrees doubles the area; on a wall, a part of the coating remains."""
    design = plain_design()
    stretched = replace(design, membrane=replace(PLAIN, stretch_loss=0.12))
    plain, dark = VirtualSensor(design), VirtualSensor(stretched)
    state = PressedMembrane(ramp(slope))
    mask = central(plain) & (led_light(plain, state)[..., 1] > 0.0)
    assert mask.sum() > 5
    ratio = led_light(dark, state)[mask, 1] / led_light(plain, state)[mask, 1]
    assert np.median(ratio) == pytest.approx(share, rel=1e-6)
    for untouched in (BareMembrane(), Whiteboard()):
        assert np.array_equal(led_light(dark, untouched), led_light(plain, untouched))


def test_the_stretch_of_a_dome_is_that_from_its_shape_at_rest():
    design = plain_design(membrane=replace(PLAIN, apex_height_mm=6.0))
    stretched = replace(design, membrane=replace(design.membrane, stretch_loss=0.5))
    plain, dark = VirtualSensor(design), VirtualSensor(stretched)
    # The slope is read between cells, that at rest is of the sphere itself.
    at_rest = led_light(plain, BareMembrane())
    assert led_light(dark, BareMembrane()) == pytest.approx(at_rest, rel=3e-4)
    # 4 mm from its axis the dome has a slope of 0.24, from which a press towards the axis takes.
    state = PressedMembrane(replace(ramp(-0.6), x0_mm=0.0))
    mask = np.hypot(plain.rays.x_mm - 4.0, plain.rays.y_mm) < 0.5
    sine = 4.0 * design.membrane.curvature_per_mm
    slope = sine / math.sqrt(1.0 - sine**2)
    gain = math.hypot(1.0, slope - 0.6) / math.hypot(1.0, slope) - 1.0
    ratio = led_light(dark, state)[mask] / led_light(plain, state)[mask]
    assert np.median(ratio) == pytest.approx(1.0 - 0.5 * gain, abs=2e-3)


def test_the_design_check_sees_what_the_gel_absorbs():
    design = SensorDesign()
    dyed = absorbing(design)
    assert veil_share(dyed) < veil_share(design)
    uneven, even = (check_design(d).quality["evenness_g"].value for d in (dyed, design))
    assert uneven < even
