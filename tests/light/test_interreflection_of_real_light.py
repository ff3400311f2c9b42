"""Interreflected light in a gel that absorbs, and from LEDs with lobes, against a slow sum."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.light.facet_interreflection import (
    FacetSurface,
    LightReceivers,
    Slab,
    gather_interreflection,
)
from gelpolight_core.light.membrane_brdf import MembraneBrdf

LEDS = np.array([[0.5, 8.0, -9.0], [-7.0, -4.0, -8.5], [8.0, -5.0, -8.0]])
SIDE, SHAPE = 0.1, (64, 96)
LOSSES = (0.01, 0.03, 0.05)
ABSORPTION = {
    f"absorption_per_mm_{key}": loss
    for key, loss in zip(("red", "green", "blue"), LOSSES, strict=True)
}
# A lobe that sends more light aside than a Lambertian one, from LEDs that lean towards the middle.
WIDE_LOBE = {
    "lobe_exponent": 0.5,
    "lobe_axis_x_red": 0.0,
    "lobe_axis_x_green": 0.25,
    "lobe_axis_x_blue": -0.3,
    "lobe_axis_y_red": -0.3,
    "lobe_axis_y_green": 0.1,
    "lobe_axis_y_blue": 0.2,
}
GLOSSY = MembraneBrdf(gloss=0.4, roughness=0.5)


def groove() -> FacetSurface:
    """Return two walls that face each other across a groove, lit evenly.

    It ends between two of the largest facets, which would be level there.
    """
    y, x = (SIDE * (np.arange(n) - 0.5 * (n - 1)) for n in SHAPE)
    x, y = np.meshgrid(x, y)
    depth = 0.9 * np.abs(x)
    normals = np.stack([-0.9 * np.sign(x), np.zeros_like(x), -np.ones_like(x)], axis=-1)
    normals /= math.hypot(0.9, 1.0)
    view = np.broadcast_to([0.0, 0.0, -1.0], normals.shape).copy()
    points = np.stack([x, y, -depth], axis=-1)
    return FacetSurface(points, normals, view, 0.01 * np.ones((*SHAPE, 3)))


def some(surface: FacetSurface) -> LightReceivers:
    """Return facets of the left wall."""
    where = np.random.default_rng(2).random(SHAPE) < 0.01
    return LightReceivers.on(surface, where & (surface.points_mm[..., 0] < -0.5))


def slow_sum(
    surface: FacetSurface, receivers: LightReceivers, membrane: MembraneBrdf, mirror_mm: float = 0.0
) -> np.ndarray:
    """Return the light that receivers get from each facet by the definition of radiance.

    A facet sends what :meth:`MembraneBrdf.direct` says in each direction, or its light of
    `surface` where the membrane is matt; with `mirror_mm`, it is mirrored below the surface.
    """
    losses = np.array([membrane.terms.get(key, 0.0) for key in ABSORPTION])
    points, normals = (part.reshape(-1, 3) for part in surface[:2])
    area = SIDE**2 / -normals[:, 2]
    received = []
    for p, n, v in zip(receivers.points_mm, receivers.normals, receivers.view, strict=True):
        at = points.copy()
        facing = normals.copy()
        if mirror_mm:
            at[:, 2] = -2.0 * mirror_mm - at[:, 2]
            facing[:, 2] *= -1.0
        way = at - p
        far = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
        towards = way / far[:, None]
        sent = surface.seen.reshape(-1, 3)
        if membrane.gloss:
            sent = -membrane.direct(LEDS, points, normals, -towards)
        solid = area * np.maximum(-(towards * facing).sum(axis=1), 0.0) / far**2
        lights = np.repeat(towards[:, None], 3, axis=1)
        shown = membrane.response(lights, np.tile(n, (len(at), 1)), np.tile(v, (len(at), 1)))
        passed = np.exp(-losses * far[:, None])
        received.append((sent * solid[:, None] * shown * passed).sum(axis=0))
    return np.array(received)


def test_a_wall_receives_less_of_each_colour_through_a_gel_that_absorbs():
    surface = groove()
    clear, dyed = MembraneBrdf(), MembraneBrdf(terms=ABSORPTION)
    receivers = some(surface)
    without, found = (
        gather_interreflection(surface, receivers, LEDS, m, SIDE).light for m in (clear, dyed)
    )
    expected = slow_sum(surface, receivers, dyed) / slow_sum(surface, receivers, clear)
    # Distant facets are gathered as larger ones, which have nearly the same paths.
    assert 1.0 - found / without == pytest.approx(1.0 - expected, rel=0.03)
    assert expected[:, 2].mean() < 0.85


def test_light_that_the_lower_face_returns_is_absorbed_on_both_ways():
    surface = groove()
    flat = surface._replace(
        points_mm=surface.points_mm * [1.0, 1.0, 0.0], normals=surface.view.copy()
    )
    receivers = some(flat)
    # Of an index so large that the face returns all light.
    slab = Slab(5.0, 1e4, 1e4)
    without, found = (
        gather_interreflection(flat, receivers, LEDS, MembraneBrdf(terms=t), SIDE, slab=slab).light
        for t in ({}, ABSORPTION)
    )
    dyed, clear = (
        slow_sum(flat, receivers, MembraneBrdf(terms=t), mirror_mm=5.0) for t in (ABSORPTION, {})
    )
    assert without == pytest.approx(clear, rel=0.03)
    assert found / without == pytest.approx(dyed / clear, abs=4e-3)


def test_terms_that_absorb_nothing_change_nothing_to_the_bit():
    surface = groove()
    receivers = some(surface)
    plain, clear, stretched, matt = (
        gather_interreflection(surface, receivers, LEDS, MembraneBrdf(terms=t), SIDE).light
        for t in ({}, dict.fromkeys(ABSORPTION, 0.0), {"stretch_loss": 0.1}, WIDE_LOBE)
    )
    for found in (clear, stretched, matt):
        assert np.array_equal(found, plain)


@pytest.mark.parametrize("terms", [WIDE_LOBE, WIDE_LOBE | ABSORPTION], ids=len)
def test_a_glossy_wall_sends_the_light_of_an_led_s_lobe(terms):
    real, surface = replace(GLOSSY, terms=terms), groove()
    receivers = some(surface)

    def share(lit_by: MembraneBrdf, known: MembraneBrdf) -> np.ndarray:
        """Return the light that is gathered over what the receivers get."""
        lit = surface._replace(seen=-lit_by.direct(LEDS, *surface[:3]))
        found = gather_interreflection(lit, receivers, LEDS, known, SIDE).light
        return np.asarray(found.sum(axis=0) / slow_sum(lit, receivers, lit_by).sum(axis=0))

    # Larger facets have another direction to the receivers, with any light.
    plain = share(GLOSSY, GLOSSY)
    assert plain == pytest.approx(1.0, abs=0.06)
    assert share(real, real) == pytest.approx(plain, rel=0.01)
    absorbing = replace(GLOSSY, terms={k: v for k, v in terms.items() if k in ABSORPTION})
    assert np.abs(share(real, absorbing) / plain - 1.0).max() > 0.05
