"""What the lower face returns to a flat membrane, against an integral over angles."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.masks import reflects_light
from gelpolight_core.reflectance.gathered_light import (
    Receivers,
    Slab,
    Surface,
    gathered,
    ratio_reflected,
    returned_to_flat,
)
from gelpolight_core.reflectance.membrane import Membrane

LEDS = np.array([[0.0, 10.0, -8.0], [-9.0, -5.0, -8.0], [9.0, -5.0, -8.0]])
SIDE, NODES = 0.2, 160


def fresnel(angle: np.ndarray, index: float) -> np.ndarray:
    """Return the reflectance of a face to air for unpolarised light from inside, by angles."""
    outside = np.arcsin(np.clip(index * np.sin(angle), 0.0, 1.0 - 1e-12))
    across = np.sin(angle - outside) / np.sin(angle + outside)
    along = np.tan(angle - outside) / np.tan(angle + outside)
    return np.where(index * np.sin(angle) >= 1.0, 1.0, 0.5 * (across**2 + along**2))


@pytest.mark.parametrize("thickness_mm", [4.0, 12.0])
def test_an_even_matt_membrane_receives_what_its_mirror_image_shows(thickness_mm: float) -> None:
    axis = SIDE * (np.arange(NODES) - 0.5 * (NODES - 1))
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    view = np.zeros_like(points)
    view[..., 2] = -1.0
    # A disc, so that the integral is over rings.
    radius = 14.0
    seen = np.where((np.hypot(x, y) < radius)[..., None], 0.3, 0.0) * np.ones(3)
    slab = Slab(thickness_mm, 1.41)
    found = returned_to_flat(seen, points, view, view, LEDS, Membrane(), SIDE, slab)
    angle = np.linspace(1e-4, np.arctan(radius / (2.0 * thickness_mm)), 20001)
    rings = fresnel(angle, 1.41) * 2.0 * np.sin(angle) * np.cos(angle)
    share = float(np.trapezoid(rings, angle))
    middle = found[NODES // 2 - 4 : NODES // 2 + 5, NODES // 2 - 4 : NODES // 2 + 5]
    assert middle.mean() / 0.3 == pytest.approx(share, rel=0.05)


def test_a_saturated_or_dim_part_reflects_light_and_a_hole_reflects_none() -> None:
    valid = np.array([[True, True, True, False]])
    # Saturated; without green and blue; a hole; outside.
    background = np.array([[[1.0, 0.3, 0.3], [0.4, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.5, 0.5]]])
    reflecting = reflects_light(valid, background)
    assert reflecting.tolist() == [[True, True, False, False]]
    ratio = np.full((1, 4, 3), 0.7)
    known = np.array([[[False], [True], [False], [False]]])
    sent = ratio_reflected(ratio, known, reflecting.astype(np.float32))
    assert sent[0, :, 0] == pytest.approx([1.0, 0.7, 0.0, 0.0])


@pytest.mark.parametrize("shape", [(96, 64), (64, 112)])
def test_a_matt_dent_receives_the_light_of_every_facet_once(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    y, x = (SIDE * (np.arange(n) - 0.4 * n) for n in shape)
    x, y = np.meshgrid(x, y)
    depth = 1.2 * np.exp(-((x - 1.0) ** 2 + (y + 0.5) ** 2) / 2.0)
    down, across = np.gradient(depth, SIDE)
    normals = np.stack([-across, -down, -np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    view = np.zeros_like(normals)
    view[..., 2] = -1.0
    points = np.stack([x, y, -depth], axis=-1)
    smooth = 1.0 + 0.2 * np.sin(0.3 * x)[..., None] + 0.1 * np.cos(0.2 * y)[..., None]
    surface = Surface(points, normals, view, 0.01 * smooth * np.array([1.0, 0.7, 0.4]))
    where = rng.random(shape) < 0.02
    found = gathered(surface, Receivers.on(surface, where), LEDS, Membrane(), SIDE)
    # What a Lambertian facet sends, and a Lambertian point shows, by the definition of radiance.
    area = SIDE**2 / -normals[..., 2]
    exact = []
    for p, n in zip(points[where], normals[where], strict=True):
        to = points - p
        square = np.maximum((to**2).sum(axis=-1), 1e-12)
        received = np.maximum(to @ n, 0.0) * np.maximum(-(to * normals).sum(axis=-1), 0.0)
        exact.append(np.einsum("ij,ijk->k", received * area / square**2, surface.seen) / np.pi)
    # Distant facets are gathered as larger ones.
    assert np.abs(found - np.array(exact)).max() < 0.05 * np.max(exact)
