"""The membrane's response: never negative, without jumps, and the published formulae."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.light.membrane_brdf import MembraneBrdf

Array = NDArray[np.float64]
UP = (0.0, 0.0, -1.0)


def unit(*parts: float) -> Array:
    vector = np.array(parts, float)
    return np.asarray(vector / np.linalg.norm(vector))


def direction(tilt: float, azimuth: float) -> Array:
    """Return a unit direction at an angle to the way to the camera."""
    sine = math.sin(tilt)
    return np.array([sine * math.cos(azimuth), sine * math.sin(azimuth), -math.cos(tilt)])


def shown(membrane: MembraneBrdf, light: Array, normal: Array, view: Array) -> float:
    """Return the brightness of one point under one light."""
    found = membrane.response(np.tile(light, (1, 3, 1)), normal[None], view[None])
    assert found.shape == (1, 3)
    assert found[0, 0] == found[0, 1] == found[0, 2]
    return float(found[0, 0])


def ggx(light: Array, normal: Array, view: Array, alpha: float) -> float:
    """Return the microfacet lobe times the light's cosine, by the angles of the definition.

    Walter, Marschner, Li, Torrance 2007: D of Eq. 33, G1 of Eq. 34, and Eq. 20 without Fresnel.
    """
    half = unit(*(light + view))
    facets = math.acos(min(1.0, float(half @ normal)))
    spread = alpha**2 / (math.pi * math.cos(facets) ** 4 * (alpha**2 + math.tan(facets) ** 2) ** 2)

    def unmasked(away: Array) -> float:
        angle = math.acos(min(1.0, float(away @ normal)))
        return 2.0 / (1.0 + math.sqrt(1.0 + (alpha * math.tan(angle)) ** 2))

    both = unmasked(light) * unmasked(view)
    return (
        spread * both / (4.0 * float(light @ normal) * float(view @ normal)) * float(light @ normal)
    )


membranes = st.builds(
    MembraneBrdf,
    exponent=st.floats(0.7, 1.8),
    gloss=st.floats(0.0, 0.9),
    roughness=st.floats(0.15, 1.0),
)
tilts, azimuths = st.floats(0.0, 1.45), st.floats(-math.pi, math.pi)
directions = st.builds(direction, tilts, azimuths)


@given(st.floats(0.0, 1.5), azimuths, st.floats(0.05, 1.0), directions)
def test_without_gloss_it_is_lamberts_law_whatever_the_view(tilt, azimuth, roughness, view):
    light = direction(tilt, azimuth)
    normal = np.array(UP)
    value = shown(MembraneBrdf(1.0, 0.0, roughness), light, normal, view)
    assert value == pytest.approx(math.cos(tilt) / math.pi, rel=1e-12)


@settings(max_examples=200)
@given(membranes, directions, directions, st.floats(0.0, 0.4), azimuths)
def test_the_glossy_share_is_the_published_microfacet_lobe(membrane, light, normal, lean, azimuth):
    view = direction(lean, azimuth)
    lit, seen = float(light @ normal), float(view @ normal)
    if lit < 0.02 or seen < 0.02:
        return  # below, the cosines are held at their least value
    expected = (1.0 - membrane.gloss) * lit**membrane.exponent / math.pi
    expected += membrane.gloss * ggx(light, normal, view, membrane.roughness)
    assert shown(membrane, light, normal, view) == pytest.approx(expected, rel=1e-9)


@given(membranes, directions, directions, directions)
def test_the_brightness_is_finite_and_never_negative(membrane, light, normal, view):
    value = shown(membrane, light, normal, view)
    assert math.isfinite(value)
    assert value >= 0.0
    if float(light @ normal) <= 0.0:
        assert value == 0.0
