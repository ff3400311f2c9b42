"""Depth from the light of real sensors, whose images the virtual sensor renders with its own laws.

The calibration is exact. Without a term, the same press is wrong by what the term does.
"""

from dataclasses import replace

import cv2
import known_press
import numpy as np
import pytest
from compiled import full_model
from numba import typeof

from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.lab.depth_score import DepthScore, score_depth
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.near_light.sensor_maps import (
    DEEP_SHARE,
    SensorMaps,
    light_by_depth,
)
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.exact_sensor import ExactPress, ExactSensor, exact_terms, matt_design

MATT = matt_design(0.25)
# They lean towards the middle, each by another angle.
INWARDS = ((0.0, -0.15), (0.12, 0.08), (-0.14, 0.1))
LENT = tuple(replace(led, axis_tilt=t) for led, t in zip(MATT.leds, INWARDS, strict=True))
ABSORBING = replace(MATT.layers, elastomer_absorption_per_mm=(0.008, 0.01, 0.018))
STRETCHED = replace(MATT.membrane, stretch_loss=0.12)
WITH_TERMS = {
    "lobe": replace(MATT, ring=replace(MATT.ring, lobe_exponent=1.6)),
    "axes": replace(MATT, leds=LENT),
    "absorption": replace(MATT, layers=ABSORBING),
    "stretch": replace(MATT, membrane=STRETCHED),
}
ALL = SensorDesign(
    camera=MATT.camera,
    layers=ABSORBING,
    leds=LENT,
    ring=WITH_TERMS["lobe"].ring,
    membrane=STRETCHED,
    photometry=MATT.photometry,
)
LARGEST = {"lobe_exponent": 1.6, "absorption_per_mm_red": 0.02, "absorption_per_mm_green": 0.0}
LARGEST["absorption_per_mm_blue"] = 0.01
for _key, _tilt in zip(("red", "green", "blue"), INWARDS, strict=True):
    LARGEST |= {f"lobe_axis_x_{_key}": _tilt[0], f"lobe_axis_y_{_key}": _tilt[1]}


def domed(design: SensorDesign) -> SensorDesign:
    """Return a design with a membrane that is a cap of 2 mm."""
    return replace(design, membrane=replace(design.membrane, apex_height_mm=2.0))


def pressed(known: ExactSensor) -> ExactPress:
    """Return the press of a cylinder beside the axis."""
    return known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=2.0, y_mm=-1.0)


def without_terms(calibration: Calibration) -> Calibration:
    """Return a calibration that does not know the terms."""
    full = calibration.data.full
    return calibration.changed(full=replace(full, membrane=replace(full.membrane, terms={})))


def scored(calibration: Calibration, press: ExactPress, effort: str) -> DepthScore:
    """Return the errors of a press."""
    found = Reconstructor(calibration, effort=effort).depth(press.frame)
    height, place = press.truth.depth_mm.max(), (found.x_mm, found.y_mm)
    return score_depth(found.depth_mm, *place, press.truth, height_mm=height, radius_mm=11.0)


@pytest.mark.parametrize("shape", ["flat", "dome"])
@pytest.mark.parametrize("effort", ["best", "fast"])
def test_a_press_has_its_height_with_each_term_and_not_without(shape, effort):
    designs = {"plain": MATT, **WITH_TERMS, "all": ALL}
    if shape == "dome":
        designs = {name: domed(design) for name, design in designs.items()}
    plain = known_press.known_sensor(designs.pop("plain"))
    expected = scored(plain.calibration, pressed(plain), effort)
    assert abs(expected.height_percent) < 1.3
    for name, design in designs.items():
        known = known_press.known_sensor(design)
        press = pressed(known)
        found = scored(known.calibration, press, effort)
        # Few pixels show the edges; the terms add nothing to what that costs.
        assert abs(found.height_percent - expected.height_percent) < 0.3, name
        assert found.rms_um < expected.rms_um + 1.0, name
        wrong = scored(without_terms(known.calibration), press, effort)
        assert abs(wrong.height_percent - expected.height_percent) > 0.6, name


@pytest.mark.parametrize("design", [ALL, domed(ALL)], ids=["flat", "dome"])
def test_the_image_of_a_true_surface_has_the_terms(design):
    """What is predicted for the true depth is the image, so that the depth of it is the truth."""
    known = known_press.known_sensor(design)
    press, calibration = pressed(known), known.calibration
    grid, truth = calibration.table.grid, press.truth
    pitch = truth.x_mm[1] - truth.x_mm[0]
    x, y = np.meshgrid((grid.x_mm - truth.x_mm[0]) / pitch, (grid.y_mm - truth.y_mm[0]) / pitch)
    places = np.float32(x), np.float32(y)
    depth = cv2.remap(np.float32(truth.depth_mm), *places, cv2.INTER_LINEAR)
    found = Reconstructor(calibration).depth(press.frame)
    true = replace(found, depth_mm=depth)
    deep = depth > 0.05
    off = median_residual(calibration, press, true, deep)
    assert off < 1.5e-3
    assert median_residual(without_terms(calibration), press, true, deep) > 5.0 * off
    untouched = Reconstructor(calibration).predict(replace(true, depth_mm=0.0 * depth))
    assert np.nanmax(np.abs(untouched - 1.0)) < 1e-3


def median_residual(
    calibration: Calibration, press: ExactPress, surface: HeightMap, where: np.ndarray
) -> float:
    """Return how far the image of a surface is from that of a press."""
    left = np.abs(Reconstructor(calibration).residual(press.frame, surface)).mean(axis=-1)
    return float(np.nanmedian(left[where]))


@pytest.mark.parametrize("surface", [FLAT, MembraneShape("spherical_cap", 2.0, 26.0)], ids=str)
def test_terms_are_a_parabola_of_the_depth_as_exactly_as_stated(surface):
    leds = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.1], [10.1, -6.3, -12.5]])
    full = full_model(MembraneBrdf(terms=LARGEST), leds)
    x, y = np.linspace(-13.0, 13.0, 41), np.linspace(-12.0, 13.0, 37)
    places = np.stack(np.meshgrid(x, y), axis=-1)
    slopes = -np.moveaxis(places, -1, 0) / 36.0
    at_rest, bent, square = np.split(light_by_depth(full, (x, y), slopes, surface), 3)
    light, length = full.membrane.light, np.sqrt(1.0 + (slopes**2).sum(axis=0))
    for depth_mm in np.linspace(0.0, DEEP_SHARE * 12.5, 7):
        moved = surface.points(places)
        moved[..., :2] += depth_mm * np.moveaxis(slopes, 0, -1)
        moved[..., 2] -= depth_mm
        exact = light.from_leds(leds, moved) * light.to_camera(depth_mm * length)
        found = at_rest + depth_mm * (bent + depth_mm * square)
        assert found == pytest.approx(np.moveaxis(1.0 / exact, -1, 0), rel=1e-4)


def test_terms_need_no_compiled_code_of_their_own():
    """A calibration without them runs the same, and at the same speed."""
    plain, real = (known_press.known_sensor(design).calibration.data for design in (MATT, ALL))
    assert exact_terms(ALL).keys() == real.full.membrane.terms.keys()
    without, known = SensorMaps(plain, plain.full), SensorMaps(real, real.full)
    assert typeof(known.membrane) == typeof(without.membrane)
    assert (known.membrane.stretch_loss > 0.0) and without.membrane.stretch_loss == 0.0
    for factor in (1, 2, 4):
        scale, other = known.scale(factor), without.scale(factor)
        assert typeof(scale) == typeof(other)
        assert scale.by_depth.shape == (9, *scale.kind.shape)
        assert not other.by_depth.size
