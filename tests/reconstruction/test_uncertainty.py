"""Honesty: what is stated beside what repeats of one press with fresh noise scatter by."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.measurement.object_measurement import measure_object
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import SD_MAPS, HeightMap
from gelpolight_core.reconstruction.near_light.depth_uncertainty import wall_sd_mm
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.exposure import exposed
from gelpolight_core.simulation.indenters import press_surface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import indenter_of
from gelpolight_core.simulation.virtual_sensor import PressedMembrane, VirtualSensor

REPEATS = 16
HONEST = 1.5


@dataclass(frozen=True)
class Repeats:
    """One press with its stated deviations, and the scatter of its repeats."""

    stated: HeightMap
    depth_sd_mm: NDArray[np.float64]
    slope_sd: NDArray[np.float64]
    measured: list[Measurement]
    distance_mm: NDArray[np.float64]

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """Flat ground, the plateau, and its wall."""
        x, y = np.meshgrid(self.stated.x_mm, self.stated.y_mm)
        good = (np.hypot(x, y) < 11.5) & (self.stated.flags == 0)
        slope = np.hypot(*np.moveaxis(self.stated.normals[..., :2], -1, 0))
        steep = slope > 0.5 * np.abs(self.stated.normals[..., 2])
        away = self.distance_mm
        solved = self.stated.depth_sd_mm > 0.0
        return {
            "flat": good & solved & (away > 5),
            "cap": away < 2,
            "wall": good & steep & (away < 4),
        }


DESIGN = SensorDesign().scaled(0.25)


@pytest.fixture(scope="module")
def light():
    """Return the light of a pressed cylinder, without noise."""
    item = DESIGN.presses[1]
    surface = press_surface(
        indenter_of(item),
        x_mm=item.x_mm,
        y_mm=item.y_mm,
        decay_mm=DESIGN.membrane.decay_length_mm,
        pitch_mm=0.04,
    )
    return VirtualSensor(DESIGN, 0).brightness(PressedMembrane(surface))


@pytest.fixture(
    scope="module", params=[1.0, pytest.param(4.0, marks=pytest.mark.long)], ids=["43 dB", "31 dB"]
)
def repeats(request, light, small_calibration):
    """Take the image of the press again and again."""
    quiet, item = DESIGN.camera, DESIGN.presses[1]
    camera = replace(
        quiet,
        shot_variance=quiet.shot_variance * request.param**2,
        read_sd=quiet.read_sd * request.param,
    )
    random = np.random.default_rng(11)
    reconstruct = Reconstructor(small_calibration)
    maps = [
        reconstruct.depth(exposed(light, camera, random), uncertainty=k == 0)
        for k in range(REPEATS)
    ]
    slopes = [m.normals[..., :2] / m.normals[..., 2:] for m in maps if m.normals is not None]
    stated = maps[0]
    x, y = np.meshgrid(stated.x_mm, stated.y_mm)
    return Repeats(
        stated,
        np.std([m.depth_mm for m in maps], axis=0, ddof=1),
        np.sqrt(0.5 * np.var(slopes, axis=0, ddof=1).sum(axis=-1)),
        [measure_object(m, shape="cylinder") for m in maps],
        np.hypot(x - item.x_mm, y - item.y_mm),
    )  # fmt: skip


@pytest.mark.function("Know the standard deviation of depth")
@pytest.mark.parametrize("region", ["flat", "cap", "wall"])
def test_depth_and_slopes_scatter_by_what_is_stated(repeats, region):
    here = repeats.regions()[region]
    assert here.sum() > 125
    pairs = (
        (repeats.stated.depth_sd_mm, repeats.depth_sd_mm),
        (repeats.stated.slope_sd, repeats.slope_sd),
    )
    for stated, seen in pairs:
        assert 1.0 / HONEST < np.median(stated[here] / seen[here]) < HONEST


def test_measured_sizes_scatter_by_what_is_stated(repeats):
    stated = repeats.measured[0].noise_sd
    height = np.std([m.height_mm for m in repeats.measured], ddof=1)
    # In much noise another fillet fits as well: what follows is part of the whole deviation.
    assert stated["height_mm"] / height < HONEST
    assert repeats.measured[0].sd["height_mm"] > height
    diameter = np.std([m.size_mm for m in repeats.measured], ddof=1)
    assert repeats.measured[0].size_sd_mm > diameter


def test_the_whole_deviation_covers_noise_and_calibration(repeats):
    first = repeats.measured[0]
    scale = repeats.stated.depth_scale_sd
    # Walls steeper than the balls of the calibration add to it.
    assert 0.95 < first.calibration_sd["height_mm"] / (scale * first.height_mm) < 3.0
    for key in ("height_mm", "diameter_mm", "drape_decay_mm"):
        both = np.hypot(first.noise_sd[key], first.calibration_sd[key])
        assert first.sd[key] >= 0.999 * both
    # The truth is within three deviations; 1 mm and 5 mm were pressed.
    assert abs(first.height_mm - 1.0) < 3.0 * first.sd["height_mm"]
    assert abs(first.size_mm - 5.0) < 3.0 * first.size_sd_mm


def test_beside_the_solved_region_nothing_scatters_and_what_is_left_out_is_stated(repeats):
    """There the depth is 0 in every repeat; true is what the drape still has."""
    stated = repeats.stated
    x, y = np.meshgrid(stated.x_mm, stated.y_mm)
    assert stated.depth_sd_mm is not None
    beside = (stated.depth_sd_mm == 0.0) & (np.hypot(x, y) < 11.5)
    if not beside.any():
        pytest.skip("so noisy an image is solved everywhere")
    # Where the region ends differs a little from repeat to repeat.
    assert np.median(repeats.depth_sd_mm[beside]) == 0.0
    assert repeats.depth_sd_mm[beside].max() < np.median(stated.depth_model_sd_mm[beside])
    decay = SensorDesign().membrane.decay_length_mm
    away = repeats.distance_mm[beside] - 2.5
    true_mm = np.exp(-away / decay)
    assert np.sqrt(np.mean(true_mm**2)) < np.median(stated.depth_model_sd_mm[beside])
    true_slope = true_mm / decay
    assert np.sqrt(np.mean(true_slope**2)) < np.median(stated.slope_model_sd[beside])


def test_the_models_own_error_is_where_the_membrane_is_pressed(repeats):
    model = repeats.stated.slope_model_sd
    parts = repeats.regions()
    assert np.median(model[parts["wall"]]) > 5.0 * np.median(model[parts["flat"]])


def test_an_image_without_information_has_finite_deviations(small_calibration):
    camera = small_calibration.camera
    for value in (0.0, 1.0, np.nan):
        rgb = np.full((camera.height, camera.width, 3), value, np.float32)
        found = Reconstructor(small_calibration).depth(rgb, uncertainty=True)
        for name in (*SD_MAPS, "noise_mm"):
            assert np.isfinite(getattr(found, name)).all(), name


def test_a_wall_is_known_to_its_node():
    """The depth of a step that lies anywhere within a node scatters as stated beside it."""
    pitch, slope = 0.1, 2.0
    x = pitch * np.arange(40.0)
    depth = np.tile(np.clip(slope * (x - 1.5), 0.0, 1.0), (9, 1)).astype(np.float32)
    stated = wall_sd_mm(depth)
    places = np.random.default_rng(0).uniform(-0.5, 0.5, 400) * pitch
    shifted = np.array([np.clip(slope * (x - 1.5 + place), 0.0, 1.0) for place in places])
    seen = shifted.std(axis=0)
    middle = (x > 1.65) & (x < 1.85)
    assert stated[4, middle] == pytest.approx(seen[middle], rel=0.1)
    assert (stated[4] >= 0.9 * seen).all()
    assert not stated[4, (x < 1.2) | (x > 2.3)].any()
