"""Shadows and normals of a surface that the rounds have found, against geometry."""

from dataclasses import replace

import compiled
import cv2
import known_press
import numpy as np
import pytest

from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.reconstruction.frame_checks import feedback_notes
from gelpolight_core.reconstruction.near_light import membrane_interreflection
from gelpolight_core.reconstruction.near_light.kernel_structures import (
    HIDDEN,
    JUDGED,
    GridRegion,
    PyramidLevel,
    RatioImage,
)
from gelpolight_core.reconstruction.near_light.membrane_interreflection import (
    CLEAR,
    InterreflectionModel,
    MembraneLight,
    SurfaceFacets,
    light_in_shadows,
    received,
    shadow_clearance,
    surface_areas,
    with_interreflection,
)
from gelpolight_core.reconstruction.near_light.sensor_maps import SensorMaps, sensor_scale
from gelpolight_core.studies.exact_sensor import matt_design

NODES, PITCH = 120, 0.1
AXIS = (PITCH * (np.arange(NODES) - NODES / 2)).astype(np.float32)
LEDS = np.array([[0.0, 10.0, -10.0], [-9.0, -5.0, -10.0], [9.0, -5.0, -10.0]], np.float32)


def test_a_plateau_hides_the_light_behind_it_as_far_as_its_shadow_reaches():
    height = 0.8
    ridge = np.where(np.abs(AXIS) < 1.0, height, 0.0).astype(np.float32)
    depth = np.ascontiguousarray(np.repeat(ridge[:, None], NODES, axis=1))
    x, y = np.meshgrid(AXIS, AXIS)
    points = np.stack([x, y, -depth], axis=-1).astype(np.float32)
    clear = shadow_clearance(
        points, depth, (AXIS[0], AXIS[0], np.float32(PITCH)), LEDS, RowThreadPool(1)
    )
    # The first LED is at y = 10 and 10 deep: at the ridge's edge, y = -1, its rays rise by
    # (10 - 0.8) / 11 of their way, so that the shadow ends 0.8 * 11 / 9.2 mm behind it.
    ends = -1.0 - height * 11.0 / (10.0 - height)
    hidden = clear[0, :, NODES // 2] < CLEAR
    behind = (AXIS < -1.0 - PITCH) & (AXIS > ends + PITCH)
    assert hidden[behind].all()
    assert not hidden[(AXIS < ends - PITCH) | (AXIS > 1.0 + PITCH)].any()
    assert not hidden[np.abs(AXIS) < 1.0 - PITCH].any()


def light_of(constant: float, by_z: float, clear: np.ndarray) -> MembraneLight:
    """Return light that is even over the surface, and grows with z of the normal."""
    around = np.zeros((12, *clear.shape[1:]), np.float32)
    around[:3], around[[5, 8, 11]] = constant, by_z
    return MembraneLight(around, clear)


def test_an_image_gets_what_is_hidden_and_what_comes_from_around():
    ratio = np.ones((3, 32, 32), np.float32)
    marks = np.full((32, 32), 1, np.uint8)
    clear = np.ones((3, 8, 8), np.float32)
    clear[1, :4] = -1.0
    normals = np.zeros_like(ratio)
    normals[0], normals[2] = 0.6, -0.8
    image = RatioImage(ratio, ratio, np.zeros((12, 1, 1), np.float32), marks)
    found = with_interreflection(image, light_of(0.3, 0.25, clear), normals)
    assert received(found.around, normals) == pytest.approx(np.full_like(ratio, 0.1))
    assert (found.marks & 1).all() and (found.marks & JUDGED).all()
    # The shadow's edge is known to half a node of the coarsest scale, two of these.
    assert ((found.marks[:18] & (HIDDEN << 1)) > 0).all()
    assert not (found.marks[20:] & (HIDDEN << 1)).any()
    assert not (found.marks & (HIDDEN | HIDDEN << 2)).any()
    # With three lights, the light follows the normal; with two, it does not.
    assert found.around[5, 31, 31] == pytest.approx(0.25)
    assert not found.around[3:, 0, 0].any()


def level(factor: int, shape: tuple[int, int]) -> PyramidLevel:
    """Return a scale whose rays spread from a camera that is nearly above a corner."""
    x, y = (0.025 * factor * np.arange(n) for n in shape[::-1])
    spread = np.stack(np.meshgrid(0.02 * x - 0.05, 0.02 * y + 0.03))
    membrane = MembraneBrdf()
    model = compiled.full_model(membrane, LEDS.astype(np.float64))
    kind = np.full(shape, 2, np.uint8)
    return sensor_scale(model, (x, y), spread, kind, factor=factor)


def test_a_normal_that_stands_out_does_not_add_to_its_own_light():
    scale, pool = level(1, (64, 64)), RowThreadPool(1)
    depth = np.zeros((64, 64), np.float32)
    depth[:, 32:] = 0.4 * 0.025 * np.arange(32)
    depth[30:32, 44] += 0.03  # a crack
    ratio = np.ones((3, 64, 64), np.float32)
    surface = SurfaceFacets.of(depth, ratio, (0, 0), scale, pool.run)
    wall = surface.normals[:, 20, 43]
    assert surface.normals[:, 30, 43] == pytest.approx(wall, abs=0.02)
    # Blocks keep what they are made of: the area of the crack, too.
    areas = surface_areas(depth, (0, 0), scale, pool.run)
    blocks = areas.reshape(3, 16, 4, 16, 4).mean(axis=(2, 4))
    blocks /= np.linalg.norm(blocks, axis=0)
    assert surface.facing == pytest.approx(blocks, abs=1e-5)
    assert surface.ratio == pytest.approx(np.ones_like(blocks))


@pytest.mark.parametrize("factor", [1, 4])
def test_areas_of_a_plane_along_tilted_rays_are_its_own(factor):
    scale = level(factor, (40, 50))
    tilt = np.array([0.5, -0.3])
    x, y = np.meshgrid(*(scale.pitch_mm * np.arange(n) for n in (50, 40)))
    wx, wy = scale.rays[:2].astype(np.float64)
    # The ray from (x, y) meets the plane z = -(0.2 + tilt . p) at this depth.
    depth = (0.2 + tilt[0] * x + tilt[1] * y) / (1.0 - tilt[0] * wx - tilt[1] * wy)
    areas = surface_areas(depth.astype(np.float32), (0, 0), scale, RowThreadPool(1).run)
    normals = areas / np.linalg.norm(areas, axis=0)
    expected = np.array([-tilt[0], -tilt[1], -1.0]) / np.sqrt(1.0 + (tilt**2).sum())
    inner = normals[:, 1:-1, 1:-1]
    assert inner == pytest.approx(np.broadcast_to(expected[:, None, None], inner.shape), abs=1e-3)
    # Seen along the rays, it covers as much as the membrane at rest, and what they spread more.
    view = np.stack([wx, wy, -np.ones_like(wx)])
    across = (areas * view).sum(axis=0)[1:-1, 1:-1]
    spread = (1.0 + 0.02 * depth[1:-1, 1:-1]) ** 2
    assert across == pytest.approx(spread, rel=1e-3)


def test_shadows_tell_how_wrong_the_interreflected_light_is():
    random = np.random.default_rng(5)
    clear = np.ones((3, 16, 16), np.float32)
    clear[0, :8] = -1.0
    normals = np.zeros((3, 64, 64), np.float32)
    normals[2] = -1.0
    ratio = np.ones((3, 64, 64), np.float32)
    ratio[0, :32] = 0.12
    ratio[0, :34, 40] = 0.9  # a scratch
    ratio += random.normal(0.0, 0.02, ratio.shape).astype(np.float32)
    marks = np.zeros((64, 64), np.uint8)
    image = RatioImage(ratio, ratio, np.zeros((12, 1, 1), np.float32), marks)
    lit = with_interreflection(image, light_of(0.05, -0.05, clear), normals)
    share = light_in_shadows(lit, normals)
    # 0.12 where 0.1 was expected, and nothing known of channels without a shadow.
    assert share[0] == pytest.approx(0.2, abs=0.05)
    assert not share[1:].any()


def test_what_feedback_leaves_is_said_only_where_it_is_strong():
    assert not feedback_notes(0.5, 0.02, 1.0)
    assert not feedback_notes(0.9, 0.002, 1.0)
    (note,) = feedback_notes(0.9, 0.05, 1.0)
    assert note.key == "light_feedback"


@pytest.mark.parametrize("shape", ["flat", "dome"])
def test_walls_receive_as_much_as_if_every_node_of_them_received_light(shape, monkeypatch):
    """Between the receivers it is interpolated, which makes it a little too dark."""
    design = matt_design(1.0)
    if shape == "dome":
        design = replace(design, membrane=replace(design.membrane, apex_height_mm=2.0))
    data = known_press.known_sensor(design).calibration.data
    membrane = replace(data.full.membrane, gloss=0.5, roughness=0.4, interreflection=0.8)
    maps, pool = SensorMaps(data, replace(data.full, membrane=membrane)), RowThreadPool(2)
    scale, region = maps.scale(1), GridRegion((90, 80), (60, 64))
    rows, columns = region.at(4)[1]
    y, x = (scale.pitch_mm * (np.arange(n) - 0.5 * n) for n in (rows, columns))
    outside = np.hypot(*np.meshgrid(x, y)) - 1.5
    drape = 0.8 * np.exp(-np.maximum(outside, 0.0) / 0.5)
    wall, face = (outside > 0.05) & (drape / 0.5 > 0.5), outside < -0.3
    ratio = np.ones((3, rows, columns), np.float32)
    surface = SurfaceFacets.of(np.float32(drape), ratio, region.at(4)[0], scale, pool.run)

    def on_wall_and_face(receivers: int, level: float) -> list[float]:
        monkeypatch.setattr(membrane_interreflection, "RECEIVERS", receivers)
        monkeypatch.setattr(membrane_interreflection, "LEVEL", level)
        light = InterreflectionModel(maps, pool).light(region, surface).around
        planes = np.stack([cv2.resize(plane, (columns, rows)) for plane in light])
        found = received(planes, surface.normals)
        return [float(found[:, part].mean()) for part in (wall, face)]

    exact = on_wall_and_face(1, 2.0)
    assert on_wall_and_face(2, 0.966) == pytest.approx(exact, rel=0.01)
    assert on_wall_and_face(4, 0.966)[0] < 0.99 * exact[0]
