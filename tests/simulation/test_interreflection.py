"""Light between parts of the simulated membrane compared with closed formulas."""

import math

import numpy as np
import pytest

from gelpolight_core.simulation import interreflection
from gelpolight_core.simulation.design_parts import CameraDesign, LayerDesign, MembraneDesign
from gelpolight_core.simulation.interreflection import FLAT, indirect_light
from gelpolight_core.simulation.lamps import PointLamp, lamp_table, lamps_of
from gelpolight_core.simulation.light_paths import membrane_hit
from gelpolight_core.simulation.membrane import even_factor
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.shading import SurfaceMaterial

HALF_ANGLE_DEG, RADIUS_MM = 72.0, 1.5
OPENING_MM = RADIUS_MM * math.sin(math.radians(HALF_ANGLE_DEG))


@pytest.fixture(autouse=True)
def few_paths(monkeypatch):
    """Nodes of a quarter of the density and fewer paths: the tests' limits allow for the noise."""
    monkeypatch.setattr(interreflection, "FINEST_MM", 0.2)
    monkeypatch.setattr(interreflection, "_STEPS", (4, 1, 1))
    monkeypatch.setattr(interreflection, "_PATHS", (256, 256, 256))


@pytest.fixture
def fewer_paths(monkeypatch):
    """As few paths as possible, where only their presence matters."""
    monkeypatch.setattr(interreflection, "_PATHS", (8, 8, 8))


def design_of(bounces: int, *, index: float = 1.41, rim_mm: float = 13.0) -> SensorDesign:
    """Return a sensor with a diffuse membrane and a camera of 80 x 60 pixels."""
    return SensorDesign(
        camera=CameraDesign(shot_variance=0.0, read_sd=0.0, blur_sigma_px=0.0),
        layers=LayerDesign(window_thickness_mm=0.0, elastomer_refractive_index=index),
        membrane=MembraneDesign(
            working_diameter_mm=2.0 * rim_mm,
            specular_weight=0.0,
            variation=0.0,
            speck_count=0,
            bounces=bounces,
        ),
    ).scaled(1.0 / 16.0)


def spherical_dent() -> PressedSurface:
    """Return a part of a sphere, concave towards the camera; its rim is the deepest place."""
    pitch = 0.02
    x = pitch * np.arange(-100, 101)
    inside = RADIUS_MM**2 - x[None] ** 2 - x[:, None] ** 2
    depth = RADIUS_MM - np.sqrt(np.maximum(inside, (RADIUS_MM * 0.2) ** 2))
    return PressedSurface(depth, depth < 0.0, float(x[0]), float(x[0]), pitch)


def in_the_dent(
    reflectance: float,
    bounces: int,
    *,
    absorption_per_mm: float = 0.0,
    stretch_loss: float = 0.0,
    within_mm: float = OPENING_MM - 0.2,
) -> np.ndarray:
    """Return the indirect light in the dent; the lamp on the sphere lights it evenly with 1."""
    design = design_of(bounces, index=1.0, rim_mm=OPENING_MM)
    # Both cosines are half the distance over the radius, so that 1/r^2 cancels.
    lamp = PointLamp(
        0.0,
        0.0,
        2.0 * RADIUS_MM,
        power=4.0 * RADIUS_MM**2,
        diameter_mm=0.0,
        absorption_per_mm=absorption_per_mm,
    )
    light = indirect_light(
        design,
        lamp_table((lamp,)),
        spherical_dent(),
        even_factor(design.membrane),
        SurfaceMaterial(reflectance, stretch_loss=stretch_loss),
    )
    cells = light.first_mm + light.pitch_mm * np.arange(light.maps.shape[1])
    return light.maps[0][np.hypot(cells[None], cells[:, None]) < within_mm]


@pytest.mark.long
def test_each_further_reflection_adds_its_term_of_the_series():
    share = 0.5 * (1.0 - math.cos(math.radians(HALF_ANGLE_DEG)))
    sums = np.array([in_the_dent(0.8, bounces).mean() for bounces in (1, 2, 3, 4)])
    terms = np.diff(sums, prepend=0.0)
    # From any point of a sphere, a part of it has its share of the area as form factor.
    expected = 0.8 * (0.8 * share) ** np.arange(1, 5)
    assert terms[:3] == pytest.approx(expected[:3], rel=0.03)
    # Fewer paths are that long.
    assert terms[3] == pytest.approx(expected[3], rel=0.2)
    assert (np.diff(terms) < 0.0).all() and (terms > 0.0).all()


@pytest.mark.parametrize(
    ("absorption_per_mm", "stretch_loss"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.25)]
)
def test_light_between_parts_is_absorbed_on_its_way_and_weaker_from_stretched_parts(
    absorption_per_mm, stretch_loss
):
    """The lowest point of the dent receives the same light from equal areas of its sphere."""
    chord_mm = np.linspace(0.0, 2.0 * RADIUS_MM * math.sin(math.radians(0.5 * HALF_ANGLE_DEG)), 999)
    from_lamp_mm = np.sqrt(4.0 * RADIUS_MM**2 - chord_mm**2)
    cos_slope = 1.0 - 0.5 * (chord_mm / RADIUS_MM) ** 2
    sent = 0.8 * (1.0 - stretch_loss * (1.0 / cos_slope - 1.0))
    sent *= np.exp(-absorption_per_mm * (from_lamp_mm + chord_mm))
    received = np.trapezoid(sent * chord_mm, chord_mm) / (2.0 * RADIUS_MM**2)
    light = in_the_dent(
        0.8, 1, absorption_per_mm=absorption_per_mm, stretch_loss=stretch_loss, within_mm=0.3
    )
    assert light.mean() == pytest.approx(0.8 * received, rel=0.03)


def flat_light(index: float, bounces: int = 4) -> np.ndarray:
    design = design_of(bounces, index=index)
    lamps, factors = lamp_table(lamps_of(design)), even_factor(design.membrane)
    return indirect_light(design, lamps, FLAT, factors, SurfaceMaterial(0.8)).maps


@pytest.mark.usefixtures("fewer_paths")
def test_a_flat_membrane_lights_itself_only_by_the_lower_face():
    assert (flat_light(1.0) == 0.0).all()
    assert flat_light(1.41).max() > 0.0


@pytest.mark.parametrize("absorption_per_mm", [0.0, 0.02])
def test_the_lower_face_returns_the_sum_over_mirror_images(absorption_per_mm):
    """Once from the membrane by the lower face: an integral over the mirrored membrane."""
    design = design_of(1)
    lamp = PointLamp(3.0, 0.0, 9.0, diameter_mm=0.0, absorption_per_mm=absorption_per_mm)
    table, factors = lamp_table((lamp,)), even_factor(design.membrane)
    light = indirect_light(design, table, FLAT, factors, SurfaceMaterial(0.8))
    step = 0.05
    x = step * (np.arange(-260, 260) + 0.5)
    x, y = np.meshgrid(x, x)
    from_lamp_mm = np.sqrt((x - 3.0) ** 2 + y**2 + 81.0)
    lit = 9.0**2 / from_lamp_mm**4 * np.exp(-absorption_per_mm * from_lamp_mm)
    lit[np.hypot(x, y) > 13.0] = 0.0
    n, away = 1.41, 2.0 * design.layers.elastomer_thickness_mm
    for at_mm in ((0.0, 0.0), (-4.0, 2.4), (9.6, -4.8)):
        r2 = (x - at_mm[0]) ** 2 + (y - at_mm[1]) ** 2 + away**2
        cosine = away / np.sqrt(r2)
        cos_air = np.sqrt(np.maximum(1.0 - n * n * (1.0 - cosine**2), 0.0))
        s = ((n * cosine - cos_air) / (n * cosine + cos_air)) ** 2
        p = ((n * cos_air - cosine) / (n * cos_air + cosine)) ** 2
        returned = 0.5 * (s + p) * np.exp(-absorption_per_mm * np.sqrt(r2))
        received = (0.8 * lit * returned * cosine**2 / (math.pi * r2)).sum() * step**2
        i, j = (round((v - light.first_mm) / light.pitch_mm) for v in (at_mm[1], at_mm[0]))
        assert light.maps[0, i, j] == pytest.approx(0.8 * received, rel=0.05)


def wall(height_mm: float) -> PressedSurface:
    """Return a steep ridge around x = 0, along y."""
    x = 0.05 * np.arange(-100, 101)
    depth = height_mm * np.clip((1.0 - np.abs(x)) / 0.3, 0.0, 1.0) * np.ones((161, 1))
    return PressedSurface(depth, depth > 0.0, float(x[0]), -4.0, 0.05)


def test_a_wall_lights_the_membrane_on_its_lit_side_and_a_higher_one_more():
    design = design_of(2, index=1.0)
    lamps, factors = lamp_table((PointLamp(8.0, 0.0, 6.0),)), even_factor(design.membrane)

    def beside(height_mm: float, x_mm: float) -> float:
        light = indirect_light(design, lamps, wall(height_mm), factors, SurfaceMaterial(0.8))
        cells = light.first_mm + light.pitch_mm * np.arange(light.maps.shape[1])
        near = (np.abs(cells[None] - x_mm) < 0.3) & (np.abs(cells[:, None]) < 2.0)
        return float(light.maps[0][near].mean())

    low, high = beside(0.5, 1.6), beside(1.0, 1.6)
    assert high > 1.3 * low > 0.0
    assert high > 3.0 * beside(1.0, -1.6)


def test_a_ray_meets_the_wall_where_the_geometry_puts_it():
    surface = wall(1.0)
    parts = (surface.depth_mm, surface.tile_max, (surface.x0_mm, surface.y0_mm, 0.05, 1.0))
    # From outside the depth map, up by 0.1 mm per mm, to the wall of depth (1 - x) / 0.3.
    length = math.hypot(1.0, 0.1)
    towards = (-1.0 / length, 0.0, -0.1 / length)
    found, x, _, d = membrane_hit(*parts, (7.0, 0.0, 0.0), towards, 0.0)
    assert found
    assert x == pytest.approx((1.0 - 0.3 * 0.7) / (1.0 - 0.03), abs=1e-5)
    assert d == pytest.approx(0.1 * (7.0 - x))
    # Steeper, it passes over the ridge and leaves towards the camera.
    assert not membrane_hit(*parts, (7.0, 0.0, 0.0), (-0.6, 0.0, -0.8), 0.0)[0]
    # From below it meets the flat part outside the map.
    found, x, _, d = membrane_hit(*parts, (7.0, 0.0, 3.0), (-0.6, 0.0, 0.8), 0.0)
    assert found
    assert (x, d) == pytest.approx((7.0 - 3.0 * 0.75, 0.0))
