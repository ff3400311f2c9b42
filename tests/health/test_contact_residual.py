"""The touched part of a frame must agree with the surface found."""

import math
import re
from dataclasses import replace

import known_press
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core import measure
from gelpolight_core.health.contact_residual import ContactLightResidual, contact_light
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import BallIndenter, CuboidIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.exact_sensor import ExactPress, ExactSensor

Map = NDArray[np.float32]


@pytest.fixture(scope="module")
def known():
    """Return a virtual sensor with its exact calibration."""
    return known_press.known_sensor(SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def press(known):
    """Return a cylinder 5 mm wide, pressed 1 mm deep."""
    return known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=1.2, y_mm=-0.8, samples=2)


def stretch_seen(known: ExactSensor, press: ExactPress) -> Map:
    """Return at every pixel how much the area of the membrane has grown, as a share."""
    truth, rays = press.truth, known.sensor.rays
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    down, across = np.gradient(truth.depth_mm.astype(float), pitch)
    stretch = np.sqrt(1.0 + down**2 + across**2) - 1.0
    places = [(rays.y_mm - truth.y_mm[0]) / pitch, (rays.x_mm - truth.x_mm[0]) / pitch]
    return np.asarray(map_coordinates(stretch, np.nan_to_num(places, nan=-9.0), order=1))


def keys(height_map: HeightMap) -> set[str]:
    """Return the keys of its findings about the contact."""
    return {found.key for found in height_map.findings} & {"stretched", "residual"}


def test_healthy_presses_agree_with_their_surface(known):
    for object_, x_mm in (
        (BallIndenter(4.0, 1.0), -3.0),
        (CuboidIndenter(6.0, 0.8), 2.0),
        (CylinderIndenter(3.0, 1.2), 0),
    ):
        image = known.noisy(known_press.on(known, object_, x_mm=x_mm, y_mm=2.0, samples=2).frame)
        for effort in ("best", "fast"):
            sensor = Reconstructor(known.calibration, effort=effort)
            assert not keys(sensor.depth(image)), (object_, effort)


@pytest.mark.parametrize("change", [-0.3, 0.15])
def test_a_coating_that_changes_where_it_is_stretched_is_doubtful_and_its_height_covered(
    known, press, change
):
    frame = press.frame * (1.0 + change * stretch_seen(known, press))[..., None].astype(np.float32)
    image = known.noisy(np.asarray(np.clip(frame, 0.0, 1.0)))
    sensor = Reconstructor(known.calibration)
    found = sensor.depth(image, uncertainty=True)
    assert keys(found) == {"stretched"}
    (finding,) = (f for f in found.findings if f.key == "stretched")
    assert finding.doubtful
    assert finding.value == pytest.approx(100.0 * change, rel=0.4)
    result = measure(found, shape="cylinder")
    assert result.verdict == "doubtful"
    assert abs(result.height_mm - 1.0) < 3.0 * result.sd["height_mm"]
    assert keys(Reconstructor(known.calibration, effort="balanced").depth(image)) == {"stretched"}


def test_an_object_that_moves_during_the_exposure_is_doubtful(known, press):
    later = known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=1.7, y_mm=-0.8, samples=2)
    image = known.noisy(np.asarray(0.5 * (press.frame + later.frame), np.float32))
    assert keys(Reconstructor(known.calibration).depth(image)) == {"residual"}


@pytest.mark.parametrize(("x_mm", "y_mm"), [(3.8, -0.8), (1.2, 1.8)])
def test_dirt_on_the_wall_of_a_contact_is_doubtful(known, press, x_mm, y_mm):
    rays = known.sensor.rays
    spot = np.hypot(rays.x_mm - x_mm, rays.y_mm - y_mm) < 0.5
    image = known.noisy(press.frame * (1.0 - 0.3 * spot)[..., None].astype(np.float32))
    found = {f.key: f for f in Reconstructor(known.calibration).depth(image).findings}
    # The cause and its place come before what follows from it.
    assert next(iter(found)) == "residual"
    place = re.search(r"\((-?[\d.]+), (-?[\d.]+)\) mm", found["residual"].text)
    assert place is not None
    assert math.dist((x_mm, y_mm), [float(v) for v in place.groups()]) < 1.0


def squares_mm(image: Map, step: int) -> tuple[Map, Map]:
    """Return the middles of squares of 0.1 mm to a node."""
    rows, columns = image.shape[-2:]
    return 0.1 * step * (np.arange(columns // step) + 0.5), 0.1 * step * (np.arange(rows) + 0.5)


def test_one_uneven_block_is_found_and_one_beside_nodes_without_light_is_not():
    gap = np.full((4, 40, 160), np.nan, np.float32)
    uneven = np.stack([np.full((40, 40), 1e-3), np.full((40, 40), 0.5)]).astype(np.float32)
    assert not contact_light(gap, 4, uneven, 0.01, squares_mm(gap, 4)).findings
    uneven[0, 20:23, 20:23] = 0.3
    assert [f.key for f in contact_light(gap, 4, uneven, 0.01, squares_mm(gap, 4)).findings] == [
        "residual"
    ]
    uneven[:, 21, 21] = np.nan
    assert not contact_light(gap, 4, uneven, 0.01, squares_mm(gap, 4)).findings


def test_the_share_by_stretch_is_found_in_noise_and_its_deviation_follows_from_the_misfit():
    random = np.random.default_rng(1)
    slope = random.uniform(0.0, 1.5, (60, 200)).astype(np.float32)
    stretch, whole = np.sqrt(1.0 + slope**2) - 1.0, np.full_like(slope, 1.2)
    noise = np.full_like(slope, 0.01)
    left = -0.08 * stretch * whole + noise * random.standard_normal(slope.shape)
    even = np.stack([np.full((60, 200), 1e-4), np.full((60, 200), 0.5)]).astype(np.float32)
    light = np.stack([left, whole, noise, slope])
    found = contact_light(light, 1, even, 0.005, squares_mm(light, 1))
    assert found.stretch == pytest.approx(-0.08, abs=0.005)
    assert 0.002 < found.stretch_sd < 0.02
    assert found.spread == pytest.approx(0.9, abs=0.15)
    level, worst = np.hypot(0.005, 0.5 / np.sqrt(12.0)), np.sqrt(2.0 * np.log(60 * 200 / 9))
    assert found.uneven == pytest.approx(1e-4 / 0.6 / level / worst, rel=1e-3)
    assert [f.key for f in found.findings] == ["stretched"]
    twice = contact_light(light, 1, even, 0.01, squares_mm(light, 1))
    assert twice.stretch_sd == pytest.approx(2.0 * found.stretch_sd, rel=0.1)


def test_a_contact_without_three_lights_says_nothing():
    gap = np.full((4, 20, 30), np.nan, np.float32)
    found = contact_light(gap, 2, gap[:2, :, ::2], 0.01, squares_mm(gap, 2))
    assert not found.findings
    assert found.times == 1.0
    assert found.darkening == 0.0


def test_deviations_are_wider_by_what_is_left_over():
    healthy = ContactLightResidual(0.01, 0.02, 0.8, 0.5)
    assert healthy.times == 1.0 and healthy.darkening == 0.0
    assert replace(healthy, spread=2.5).times == 2.5
    assert 0.0 < replace(healthy, stretch=0.05).darkening < 0.05
