"""The check of a sensor before it is built."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.base.finding import Verdict
from gelpolight_core.simulation.design_check import blocked_pixels, check_design
from gelpolight_core.simulation.design_parts import LayerDesign, LedDesign, LedRing
from gelpolight_core.simulation.reflections import led_reflections
from gelpolight_core.simulation.sensor_design import SensorDesign


def ring(radius: float, height: float, *, angles=(90.0, 210.0, 330.0)) -> SensorDesign:
    """Return the default sensor with its LEDs on another circle."""
    leds = tuple(
        LedDesign(radius * math.cos(math.radians(a)), radius * math.sin(math.radians(a)), height)
        for a in angles
    )
    return replace(SensorDesign(), leds=leds)


def test_the_default_design_passes():
    result = check_design(SensorDesign())
    assert result.quality.verdict is Verdict.PASS
    assert 2.6 < result.quality["light_condition"].value < 3.9


def test_lights_on_one_side_are_refused():
    result = check_design(ring(12.0, 13.7, angles=(80.0, 90.0, 100.0)))
    assert result.quality["light_condition"].verdict is Verdict.FAIL
    assert result.quality["light_condition"].remedy


def test_leds_below_the_layers_show_their_mirror_image():
    layers = LayerDesign(tilt_deg=0.0, tilt_azimuth_deg=0.0)
    camera = replace(SensorDesign().camera, distortion=(0.0, 0.0, 0.0, 0.0))
    design = replace(ring(5.0, 18.0), layers=layers, camera=camera)
    result = check_design(design)
    assert result.quality["lower_face_reflections"].verdict is Verdict.FAIL
    assert result.quality["led_outside_elastomer"].verdict is Verdict.WARN
    image = next(r for r in result.reflections if r.led == "R")
    # LED 2 mm below the face at 16 mm: its mirror image is at 14 mm, 25 mm from the camera.
    assert image.pixel == pytest.approx((camera.cx, camera.cy + camera.fy * 5.0 / 25.0))
    assert image.at_mm == pytest.approx((0.0, 5.0 * 23.0 / 25.0), abs=1e-9)
    # Near the normal the face reflects ((n - 1) / (n + 1))^2.
    assert image.reflectance == pytest.approx((0.49 / 2.49) ** 2, rel=0.02)


def test_image_in_the_top_surface_obeys_the_law_of_reflection():
    design = replace(ring(12.0, 13.7), layers=LayerDesign(tilt_deg=0.0, window_thickness_mm=0.0))
    image = next(r for r in led_reflections(design) if r.face == "top surface" and r.led == "R")
    y = image.at_mm[1]
    inside = math.atan((12.0 - y) / 13.7)
    out = math.asin(1.41 * math.sin(inside))
    # Down through 14 mm at the angle of arrival, then refracted to the axis 25 mm further.
    assert y == pytest.approx(14.0 * math.tan(inside) + 25.0 * math.tan(out), abs=1e-6)


def test_leds_over_the_membrane_hide_it():
    design = replace(ring(4.0, 13.7), ring=LedRing(body_diameter_mm=2.0))
    result = check_design(design)
    assert result.quality["blocked_share"].verdict is Verdict.FAIL
    blocked, _ = blocked_pixels(design)
    assert blocked.sum() > 1000
    # Three equal bodies around the axis hide equal parts of the image around its centre.
    rows, columns = np.nonzero(blocked)
    assert abs(columns.mean() - design.camera.cx) < 40.0
    assert abs(rows.mean() - design.camera.cy) < 40.0


def test_a_glossy_membrane_is_reported():
    membrane = replace(SensorDesign().membrane, specular_weight=0.95, roughness=0.1)
    figure = check_design(replace(SensorDesign(), membrane=membrane)).quality["membrane_gloss"]
    assert figure.verdict is Verdict.FAIL
    assert "(" in figure.remedy


def test_a_thin_elastomer_lets_the_lower_face_fill_the_shadows():
    thick = check_design(ring(12.0, 13.7)).quality["lower_face_veil"].value
    thin = replace(
        ring(12.0, 5.0), layers=LayerDesign(elastomer_thickness_mm=5.0, window_thickness_mm=0.0)
    )
    assert check_design(thin).quality["lower_face_veil"].value > 2.0 * thick
