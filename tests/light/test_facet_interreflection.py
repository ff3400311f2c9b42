"""What the lower face returns to a flat membrane, against an integral over angles."""

import numpy as np
import pytest

from gelpolight_core.base.membrane_masks import reflects_light
from gelpolight_core.geometry.membrane_shape import MembraneShape as AtRest
from gelpolight_core.geometry.refraction import LayerStack
from gelpolight_core.light.facet_interreflection import (
    FacetSurface,
    LightReceivers,
    ReceivedLight,
    Slab,
    coarse_facets,
    gather_interreflection,
    interreflection_of_flat,
    projected_facet_area,
    ratio_reflected,
)
from gelpolight_core.light.membrane_brdf import MembraneBrdf

LEDS = np.array([[0.0, 10.0, -8.0], [-9.0, -5.0, -8.0], [9.0, -5.0, -8.0]])
SIDE, NODES = 0.2, 160


def fresnel(angle: np.ndarray, index: float) -> np.ndarray:
    """Return the reflectance of a face to air for unpolarised light from inside, by angles."""
    outside = np.arcsin(np.clip(index * np.sin(angle), 0.0, 1.0 - 1e-12))
    across = np.sin(angle - outside) / np.sin(angle + outside)
    along = np.tan(angle - outside) / np.tan(angle + outside)
    return np.where(index * np.sin(angle) >= 1.0, 1.0, 0.5 * (across**2 + along**2))


@pytest.mark.parametrize(("thickness_mm", "window"), [(4.0, 1.41), (12.0, 1.41), (12.0, 1.6)])
def test_an_even_matt_membrane_receives_what_its_mirror_image_shows(thickness_mm, window):
    axis = SIDE * (np.arange(NODES) - 0.5 * (NODES - 1))
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    view = np.zeros_like(points)
    view[..., 2] = -1.0
    # A disc, so that the integral is over rings.
    radius = 14.0
    seen = np.where((np.hypot(x, y) < radius)[..., None], 0.3, 0.0) * np.ones(3)
    # A window that is too thin to move the light, but reflects more.
    slab = Slab.of(LayerStack((20.0, 1e-6, thickness_mm), (1.0, window, 1.41)))
    found = interreflection_of_flat(seen, points, view, view, LEDS, MembraneBrdf(), SIDE, slab)
    angle = np.linspace(1e-4, np.arctan(radius / (2.0 * thickness_mm)), 20001)
    inside = np.arcsin(1.41 * np.sin(angle) / window)
    rings = fresnel(inside, window) * 2.0 * np.sin(angle) * np.cos(angle)
    share = float(np.trapezoid(rings, angle))
    middle = found[NODES // 2 - 4 : NODES // 2 + 5, NODES // 2 - 4 : NODES // 2 + 5]
    assert middle.mean() / 0.3 == pytest.approx(share, rel=0.05)


def test_a_saturated_or_dim_part_reflects_light_and_a_hole_reflects_none():
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
def test_a_matt_dent_receives_the_light_of_every_facet_once(shape):
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
    surface = FacetSurface(points, normals, view, 0.01 * smooth * np.array([1.0, 0.7, 0.4]))
    where = rng.random(shape) < 0.02
    found = gather_interreflection(
        surface, LightReceivers.on(surface, where), LEDS, MembraneBrdf(), SIDE
    ).light
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
    # What receives much of it, on the walls, must receive it rightly.
    lit = np.array(exact)[:, 0] > 0.2 * np.max(exact)
    assert found[lit].sum() == pytest.approx(np.array(exact)[lit].sum(), rel=0.02)


def test_an_even_matt_cap_lights_itself_evenly():
    axis = SIDE * (np.arange(NODES) - 0.5 * (NODES - 1))
    x, y = np.meshgrid(axis, axis)
    places, cap = np.stack([x, y], axis=-1), AtRest("spherical_cap", 3.5, 26.0)
    points, normals, inside = cap.points(places), cap.normals(places), np.hypot(x, y) < 13.0
    # A camera 30 mm below the boundary.
    view = np.array([0.0, 0.0, -30.0]) - points
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    seen = np.where(inside[..., None], 0.3, 0.0) * np.ones(3)
    surface = FacetSurface(points, normals, view, seen, projected_facet_area(points, view, SIDE))
    where = (np.hypot(x, y) < 11.0) & (np.arange(NODES) % 7 == 0)
    found = (
        gather_interreflection(
            surface, LightReceivers.on(surface, where), LEDS, MembraneBrdf(), SIDE
        ).light
        / 0.3
    )
    # From anywhere on a sphere, a part of it is seen as its share of the sphere's area.
    sphere_mm = (13.0**2 + 3.5**2) / (2.0 * 3.5)
    assert found == pytest.approx(3.5 / (2.0 * sphere_mm), rel=0.03)


def test_what_is_pressed_hides_one_side_of_a_cap_from_the_other():
    side = 0.1
    axis = side * (np.arange(272) - 135.5)
    x, y = np.meshgrid(axis, axis)
    places, cap = np.stack([x, y], axis=-1), AtRest("spherical_cap", 3.5, 26.0)

    def height(at: np.ndarray) -> np.ndarray:
        bump = 1.6 * np.exp(-((((at - [1.5, -1.0]) ** 2).sum(axis=-1) / 2.4) ** 2))
        return np.asarray(cap.height(at) - bump)

    slopes = [(height(places + s) - height(places - s)) / 2e-4 for s in 1e-4 * np.eye(2)]
    normals = np.stack([*slopes, -np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    points = np.concatenate([places, height(places)[..., None]], axis=-1)
    view = np.zeros_like(points)
    view[..., 2] = -1.0
    seen = np.where((np.hypot(x, y) < 13.0)[..., None], 0.3, 0.0) * np.ones(3)
    surface = FacetSurface(points, normals, view, seen, projected_facet_area(points, view, side))
    seen_through = surface._replace(across=None)  # the same seen from above, but nothing hides
    away = np.hypot(x - 1.5, y + 1.0)
    where = (away > 3.5) & (away < 7.0) & (np.hypot(x, y) < 11.0)
    where &= np.random.default_rng(3).random(x.shape) < 0.003
    all_of_it, found = (
        gather_interreflection(
            one, LightReceivers.on(one, where), LEDS, MembraneBrdf(), side
        ).light[:, 0]
        for one in (seen_through, surface)
    )
    # What hides the facets of one point hides none of the next one.
    receivers = LightReceivers.on(surface, where)
    alone = [
        gather_interreflection(
            surface, LightReceivers(*(part[[k]] for part in receivers)), LEDS, MembraneBrdf(), side
        ).light[0, 0]
        for k in range(0, len(found), 7)
    ]
    assert found[::7] == pytest.approx(np.array(alone), rel=1e-6)
    hidden, t = [], np.linspace(0.02, 0.98, 49)[:, None, None]
    for p, n in zip(points[where], normals[where], strict=True):
        to = points[::4, ::4].reshape(-1, 3) - p
        square = np.maximum((to**2).sum(axis=-1), 1e-9)
        own = normals[::4, ::4].reshape(-1, 3)
        received = np.maximum(to @ n, 0.0) * np.maximum(-(to * own).sum(axis=-1), 0.0) / square**2
        light = received * (4.0 * side) ** 2 / -own[:, 2] * seen[::4, ::4, 0].ravel() / np.pi
        line = p + t * to
        stopped = (line[..., 2] > height(line[..., :2]) + 1e-3).any(axis=0)
        hidden.append(float(light[stopped].sum()))
    assert np.mean(hidden) > 0.1 * np.mean(found)
    assert np.abs(all_of_it - found - hidden).max() < 0.25 * np.mean(hidden)


@pytest.mark.parametrize("membrane", [MembraneBrdf(), MembraneBrdf(gloss=0.5, roughness=0.35)])
def test_the_derivative_by_the_receiver_s_normal_is_that_of_the_light(membrane):
    axis = SIDE * (np.arange(64) - 31.5)
    x, y = np.meshgrid(axis, axis)
    depth = 1.5 * np.exp(-(((x - 0.4) ** 2 + (y + 0.7) ** 2) ** 2) / 20.0)
    down, across = np.gradient(depth, SIDE)
    normals = np.stack([-across, -down, -np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    view = np.broadcast_to([0.1, -0.05, -np.sqrt(1.0 - 0.0125)], normals.shape)
    points = np.stack([x, y, -depth], axis=-1)
    seen = -membrane.direct(LEDS, points, normals, view)
    surface = FacetSurface(points, normals, view, seen)
    wall = LightReceivers.on(surface, (normals[..., 2] > -0.9) & (normals[..., 2] < -0.5))
    slab = Slab(8.0, 1.41, 1.41)

    def received(moved: np.ndarray) -> ReceivedLight:
        here = wall._replace(normals=moved)
        return gather_interreflection(surface, here, LEDS, membrane, SIDE, slab=slab)

    found = received(wall.normals)
    for axis_number, step in enumerate(0.005 * np.eye(3)):
        more, less = (received(wall.normals + sign * step).light for sign in (1.0, -1.0))
        slope = (more - less) / 0.01
        error = found.by_normal[..., axis_number] - slope
        # Facets at the horizon of a point turn on or off.
        assert np.abs(error).mean() < 0.02 * np.abs(found.by_normal).mean()
    if not membrane.gloss:
        product = np.einsum("ikl,il->ik", found.by_normal, wall.normals)
        assert product == pytest.approx(found.light, rel=1e-3)


def test_wider_facets_keep_the_areas_of_a_wall_and_the_light_that_it_sends():
    x, y = np.meshgrid(SIDE * np.arange(31.0), SIDE * np.arange(22.0))
    depth = np.where(x < 3.0, 1.5 * (3.0 - x), 0.0)  # 56 degrees, and flat ground
    normals = np.where((x < 3.0)[..., None], [1.5, 0.0, -1.0], [0.0, 0.0, -1.0])
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    view = np.broadcast_to([0.0, 0.0, -1.0], normals.shape)
    seen = np.where(x < 3.0, 0.5, 1.0)[..., None] * [1.0, 0.6, 0.2]
    surface = FacetSurface(np.stack([x, y, -depth], axis=-1), normals, view, seen)

    def sums(facets: FacetSurface, side: float) -> tuple[np.ndarray, np.ndarray]:
        across = -facets.view[..., 2] if facets.across is None else facets.across
        facing = (facets.view * facets.normals).sum(axis=-1)
        area = (across / facing)[..., None] * side**2
        vector = (facets.normals * area).sum(axis=(0, 1))
        return vector, (facets.seen * area).sum(axis=(0, 1))

    fine, side = sums(surface, SIDE), SIDE
    for _ in range(3):
        surface, side = coarse_facets(surface), 2.0 * side
        found = sums(surface, side)
        assert found[0] == pytest.approx(fine[0], rel=1e-4, abs=1e-4)
        assert found[1] == pytest.approx(fine[1], rel=0.03)
