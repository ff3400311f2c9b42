"""The virtual sensor's light, rays and shadows compared with closed formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.simulation.design_parts import CameraDesign, LayerDesign, MembraneDesign
from gelpolight_core.simulation.exposure import exposed
from gelpolight_core.simulation.indenters import CylinderIndenter, press_surface
from gelpolight_core.simulation.lamps import lamp_table
from gelpolight_core.simulation.occlusion import visible_depth
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.rays import project_through_layers, trace_pixels
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    Mirror,
    PressedMembrane,
    VirtualSensor,
    Whiteboard,
)
from tests.studies.point_light import lit_share, parallel_light

QUIET = CameraDesign(shot_variance=0.0, read_sd=0.0, blur_sigma_px=0.0)
PLAIN = MembraneDesign(specular_weight=0.0, variation=0.0, speck_count=0)


def small_design(**changes: object) -> SensorDesign:
    """Return the default sensor with a noise-free camera of 160 x 120 pixels."""
    return replace(SensorDesign(camera=QUIET, membrane=PLAIN), **changes).scaled(0.125)


def straight_stack(distance: float = 39.0) -> LayerDesign:
    return LayerDesign(
        top_distance_mm=distance, tilt_deg=0.0, tilt_azimuth_deg=0.0, window_thickness_mm=0.0
    )


def step_surface(height: float = 1.0, *, pitch: float = 0.02, edge_mm: float = 0.0):
    """Return a surface that is `height` deep left of x = edge and flat right of it."""
    x = pitch * np.arange(-250, 251)
    depth = np.where(x <= edge_mm, height, 0.0) * np.ones((201, 1))
    return PressedSurface(depth, depth > 0, float(x[0]), -100 * pitch, pitch)


def test_whiteboard_brightness_follows_the_near_light_formula():
    sensor = VirtualSensor(small_design(layers=straight_stack()))
    light = np.linalg.solve(
        np.array(sensor.design.photometry.crosstalk),
        sensor.brightness(Whiteboard()).reshape(-1, 3).T,
    ).T.reshape(120, 160, 3)
    rays = sensor.rays
    inside = np.hypot(rays.x_mm, rays.y_mm) < 12.5
    for k, led in enumerate(sensor.design.leds):
        away = (led.x_mm - rays.x_mm) ** 2 + (led.y_mm - rays.y_mm) ** 2
        r2 = away + led.height_mm**2
        expected = led.power * (led.height_mm**2 / r2) / r2 * rays.transmission
        ratio = light[..., k][inside] / expected[inside]
        assert np.ptp(ratio) / ratio.mean() < 1e-9


@given(st.floats(0.0, 600.0), st.floats(10.0, 80.0), st.floats(0.5, 30.0))
@settings(max_examples=50, deadline=None)
def test_straight_stack_bends_rays_as_equation_3_says(d, z2, z1):
    f, n = 1385.6, 1.41
    camera = CameraDesign(
        width_px=16, height_px=16, fx=f, fy=f, cx=-d, cy=7.0, distortion=(0.0, 0.0, 0.0, 0.0)
    )
    layers = replace(straight_stack(z1 + z2), elastomer_thickness_mm=z1)
    alpha = math.atan(d / f)
    beta = math.asin(math.sin(alpha) / n)
    on_top = z2 * math.tan(alpha) + z1 * math.tan(beta)
    assert trace_pixels(camera, layers).x_mm[7, 0] == pytest.approx(on_top, abs=1e-9)


@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(-8, 0), st.floats(0, 5))
@settings(max_examples=40, deadline=None)
def test_a_point_projected_through_the_layers_lies_on_its_pixels_ray(x, y, z, tilt):
    layers = LayerDesign(tilt_deg=tilt)
    camera = CameraDesign()
    u, v = project_through_layers(camera, layers, np.array([x, y, z]))
    one = replace(camera, width_px=16, height_px=16, cx=camera.cx - u, cy=camera.cy - v)
    rays = trace_pixels(one, layers)
    seen_x = rays.x_mm[0, 0] + z * rays.slope_x[0, 0]
    seen_y = rays.y_mm[0, 0] + z * rays.slope_y[0, 0]
    assert math.hypot(seen_x - x, seen_y - y) < 1e-8


def test_mirror_spots_stand_at_the_mirror_twins():
    design = replace(SensorDesign(camera=replace(QUIET, distortion=(0.0, 0.0, 0.0, 0.0))))
    image = np.linalg.solve(
        np.array(design.photometry.crosstalk),
        VirtualSensor(design).brightness(Mirror()).reshape(-1, 3).T,
    ).T.reshape(960, 1280, 3)
    layers, camera = design.layers, design.camera
    normal = layers.normal_camera
    across = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    across /= np.linalg.norm(across)
    v, u = np.mgrid[:960, :1280]
    for k, led in enumerate(design.leds):
        lamp = (
            (layers.top_distance_mm - led.height_mm) * normal
            + led.x_mm * across
            + led.y_mm * np.cross(normal, across)
        )
        twin = lamp + 2.0 * (layers.top_distance_mm - normal @ lamp) * normal
        weight = image[..., k]
        spot = np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()
        expected = camera.fx * twin[:2] / twin[2] + (camera.cx, camera.cy)
        # 8 x 8 rays per pixel locate the centroid of a 5 px disc to a few hundredths.
        assert np.allclose(spot, expected, atol=0.03)


@pytest.mark.parametrize("elevation", [20.0, 35.0, 50.0])
def test_step_throws_a_shadow_of_its_height_over_the_tangent(elevation):
    surface = step_surface(1.0)
    lamp = parallel_light(180.0, elevation)
    share = lit_share(
        surface.depth_mm,
        surface.tile_max,
        (surface.x0_mm, surface.y0_mm, surface.pitch_mm, 1.0),
        (surface.slope_x, surface.slope_y),
        lamp_table((lamp,)),
    )[100, :, 0]
    length = (share[surface.x_mm > 0.02] < 0.5).sum() * surface.pitch_mm
    # Two cells: the step itself lies between two cells, and the march goes by 0.7 cells.
    assert length == pytest.approx(1.0 / math.tan(math.radians(elevation)), abs=0.04)


def test_a_wall_turned_from_the_camera_is_hidden_behind_the_plateau():
    surface = step_surface(1.0)
    parts = (surface.depth_mm, surface.tile_max, surface.tile_min, 1.0)
    middle = (0.0 - surface.y0_mm) / surface.pitch_mm

    def depth_seen(x_on_top: float) -> float:
        # The camera is at the left: its ray goes right by 0.5 mm per mm towards the membrane.
        cell = ((x_on_top - surface.x0_mm) / surface.pitch_mm, middle)
        return visible_depth(*parts, cell, (-0.5 / surface.pitch_mm, 0.0))

    # The ray over the edge of the step meets the flat part 0.5 mm further right: nothing before is
    # visible.
    assert depth_seen(0.45) == pytest.approx(1.0, abs=1e-6)
    assert depth_seen(0.56) == pytest.approx(0.0, abs=1e-6)
    seen = np.array([depth_seen(x) for x in np.linspace(-1.0, 2.0, 400)])
    assert ((seen > 0.05) & (seen < 0.95)).sum() <= 4


def test_camera_sees_a_pressed_rim_where_the_projection_puts_it():
    design = SensorDesign(camera=QUIET, membrane=PLAIN)
    sensor = VirtualSensor(design)
    surface = press_surface(CylinderIndenter(5.0, 1.0, 0.0), x_mm=4.0, y_mm=3.0)
    flat = sensor.brightness(PressedMembrane(surface), samples=1).sum(axis=2)
    for way in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)):
        along = np.arange(1.5, 3.2, 0.01)[:, None]
        points = np.hstack([(4.0, 3.0) + along * way, np.full_like(along, -1.0)])
        u, v = np.rint(project_through_layers(design.camera, design.layers, points)).T.astype(int)
        change = np.abs(np.gradient(flat[v, u]))
        # The brightness of the face ends at its rim, 2.5 mm from its centre, to a pixel.
        assert along[np.argmax(change > 10.0 * np.median(change[:50]) + 0.01), 0] == pytest.approx(
            2.5, abs=0.06
        )


def test_noise_has_the_stated_variance():
    camera = CameraDesign(bit_depth=16, shot_variance=4e-4, read_sd=0.004)
    signal = np.full((500, 500), 0.4)
    frame = exposed(signal, camera, np.random.default_rng(3)) / 65535.0
    single = 4e-4 * 0.4 + 0.004**2
    # The relative sd of a variance of N = 250000 values is sqrt(2 / N) = 0.3 %.
    assert frame.var() == pytest.approx(single, rel=0.015)
    mean = exposed(signal, camera, np.random.default_rng(3), averaged=8) / 65535.0
    assert mean.var() == pytest.approx(single / 8.0, rel=0.015)


def test_one_seed_gives_one_sequence_of_bytes():
    design = small_design(camera=replace(QUIET, read_sd=0.01), membrane=MembraneDesign())
    first, second = VirtualSensor(design, 5), VirtualSensor(design, 5)
    frames = [first.frame(BareMembrane()) for _ in range(2)]
    assert np.array_equal(frames[0], second.frame(BareMembrane()))
    assert np.array_equal(frames[1], second.frame(BareMembrane()))
    assert not np.array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[0], VirtualSensor(design, 6).frame(BareMembrane()))
