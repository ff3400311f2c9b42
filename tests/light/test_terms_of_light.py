"""The terms of a real sensor's light against closed formulas by angles and paths."""

import math

import numpy as np
import pytest

from gelpolight_core.light.led_lobe import exponent_prior, lobe_exponent
from gelpolight_core.light.light_terms import LEAST_SLANT, LIGHT_TERMS, LightTerms
from gelpolight_core.light.membrane_brdf import MembraneBrdf

LEDS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.1], [10.1, -6.3, -12.5]])
# Unlike in x and y, so that an exchange of the two shows.
PLACES = np.array([[4.0, -2.0, 0.0], [-7.5, 1.0, -1.2], [0.3, 9.0, -0.4]])
EXPONENT = 1.6
TILTS = {"red": (0.08, -0.03), "green": (-0.2, 0.11), "blue": (0.02, 0.25)}
LOBE = {"lobe_exponent": EXPONENT} | {
    f"lobe_axis_{axis}_{key}": tilt[i] for key, tilt in TILTS.items() for i, axis in enumerate("xy")
}
LOSSES = (0.004, 0.02, 0.009)
ABSORPTION = {f"absorption_per_mm_{key}": loss for key, loss in zip(TILTS, LOSSES, strict=True)}
STRETCH = {"stretch_loss": 0.12}


def lobe_of(led: np.ndarray, tilt: tuple[float, float], place: np.ndarray) -> float:
    """Return the light of a lobe over that of a Lambertian LED, by the angles of the way."""
    way = place - led
    across = math.hypot(way[0], way[1])
    from_z, azimuth = math.atan2(across, way[2]), math.atan2(way[1], way[0])
    leaning, towards = math.atan(math.hypot(*tilt)), math.atan2(tilt[1], tilt[0])
    # The law of cosines on a sphere.
    from_axis = math.cos(from_z) * math.cos(leaning)
    from_axis += math.sin(from_z) * math.sin(leaning) * math.cos(azimuth - towards)
    return float(from_axis**EXPONENT / math.cos(from_z))


def test_each_led_has_its_own_axis():
    found = LightTerms(LOBE).from_leds(LEDS, PLACES)
    expected = [
        [lobe_of(led, tilt, place) for led, tilt in zip(LEDS, TILTS.values(), strict=True)]
        for place in PLACES
    ]
    assert found == pytest.approx(np.array(expected), rel=1e-12)


def test_a_colour_is_absorbed_on_the_way_from_its_led_and_less_on_a_shorter_way_to_the_camera():
    light = LightTerms(ABSORPTION)
    ways = [[math.dist(led, place) for led in LEDS] for place in PLACES]
    assert light.from_leds(LEDS, PLACES) == pytest.approx(np.exp(-np.array(LOSSES) * ways))
    nearer_mm = np.array([0.0, 1.5])
    gained = light.to_camera(nearer_mm)
    assert gained[0].tolist() == [1.0, 1.0, 1.0]
    assert gained[1] == pytest.approx([math.exp(1.5 * loss) for loss in LOSSES])


def test_a_pressed_wall_is_darker_by_the_area_that_it_gains():
    light = LightTerms(STRETCH)
    # A membrane that is flat at rest, and one that has a slope of 30 degrees there.
    for rest_deg in (0.0, 30.0):
        tilts_deg = np.array([rest_deg, 45.0, 60.0])
        rest_z = -math.cos(math.radians(rest_deg))
        z = -np.cos(np.radians(tilts_deg))
        z[0] = rest_z
        seen = light.seen(np.zeros(3), z, rest_z)
        assert seen[0].tolist() == [1.0, 1.0, 1.0]  # exactly: what nothing touches is as it was
        areas = math.cos(math.radians(rest_deg)) / np.cos(np.radians(tilts_deg))
        assert seen[:, 1] == pytest.approx(1.0 - 0.12 * (areas - 1.0))
    steepest = light.seen(np.zeros(2), np.array([-LEAST_SLANT, 0.0]))
    assert steepest[0] == pytest.approx(steepest[1])
    dark = LightTerms({"stretch_loss": 1.0}).seen(np.zeros(1), np.array([-0.1]))
    assert (dark == 0.3).all()


def test_all_terms_act_together_and_none_changes_nothing():
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(3, 3)) * [0.3, 0.3, 0.0] - [0.0, 0.0, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    view = np.tile([0.0, 0.0, -1.0], (3, 1))
    plain = MembraneBrdf(1.1, 0.2, 0.4)
    real = MembraneBrdf(1.1, 0.2, 0.4, terms=LOBE | ABSORPTION | STRETCH)
    without, direct = (m.direct(LEDS, PLACES, normals, view) for m in (plain, real))
    lobe, absorbed = (LightTerms(v).from_leds(LEDS, PLACES) for v in (LOBE, ABSORPTION))
    assert direct == pytest.approx(without * lobe * absorbed)
    seen = real.light.seen(np.full(3, 0.7), normals[:, 2])
    stretched = LightTerms(STRETCH).seen(np.zeros(3), normals[:, 2])
    assert seen == pytest.approx(stretched * np.exp(0.7 * np.array(LOSSES)))
    nothing = LightTerms({})
    assert (nothing.from_leds(LEDS, PLACES) == 1.0).all()
    assert (nothing.seen(np.full(3, 0.7), normals[:, 2]) == 1.0).all()


@pytest.mark.parametrize("term", LIGHT_TERMS, ids=lambda term: term.key)
def test_a_term_with_an_impossible_value_is_refused(term):
    values = {p.full_key: p.neutral for p in term.parameters}
    LightTerms(values).check()
    for parameter in term.parameters:
        low, high = parameter.limits
        for wrong in (low - 1e-3, high + 1e-3, math.nan):
            with pytest.raises(ValueError, match=r"is "):
                LightTerms({**values, parameter.full_key: wrong}).check()


@pytest.mark.parametrize("half_angle_deg", [50.0, 60.0, 75.0])
def test_a_half_angle_is_where_half_of_the_light_is_left(half_angle_deg):
    exponent = lobe_exponent(half_angle_deg)
    assert math.cos(math.radians(half_angle_deg)) ** exponent == pytest.approx(0.5)
    prior = exponent_prior(half_angle_deg)
    assert prior.mean == exponent
    ends = [lobe_exponent(half_angle_deg + step) for step in (-0.01, 0.01)]
    assert prior.sd == pytest.approx((ends[0] - ends[1]) / 0.02 * 5.0, rel=1e-4)
