"""A change of exposure or of an LED by some percent is measured and undone."""

from collections.abc import Sequence

import known_press
import numpy as np
import pytest

from gelpolight_core.health.frame_health import FrameHealth, LightGain
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.exact_sensor import ExactPress
from gelpolight_core.studies.image_case_helpers import depth_error, rms_um

TEN_UM = 10.0
CORRECTION = "light of the image"
CHANGES = {
    "exposure 3 % longer": (1.03, 1.03, 1.03),
    "exposure 0.2 % longer": (1.002, 1.002, 1.002),
    "all LEDs otherwise": (0.98, 1.02, 1.01),
    "half the exposure": (0.5, 0.5, 0.5),
    "red LED 40 % weaker": (0.6, 1.0, 1.0),
}


@pytest.fixture(scope="module")
def known():
    """Return a sensor with specks, crosstalk and gloss, and its exact calibration."""
    return known_press.known_sensor(SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def press(known):
    """Return a press without noise."""
    return known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=1.2, y_mm=-0.8)


def error_um(found: HeightMap, press: ExactPress) -> float:
    """Return the depth's error over the working circle, root mean square."""
    return rms_um(depth_error(found, press.truth, radius_mm=12.0))


@pytest.mark.function("Correct a change of light")
@pytest.mark.parametrize(
    ("model", "effort"), [("full", "best"), ("full", "fast"), ("paper", "best")]
)
def test_a_change_of_light_costs_less_than_ten_micrometres(known, press, model, effort):
    reconstructor = Reconstructor(known.calibration, model=model, effort=effort)
    usual = error_um(reconstructor.depth(known.noisy(press.frame), normals=False), press)
    for name, shares in CHANGES.items():
        frame = known.noisy(press.frame * np.array(shares, np.float32))
        found = reconstructor.depth(frame, normals=False)
        assert abs(error_um(found, press) - usual) < 0.3 * TEN_UM, name
        np.testing.assert_allclose(found.health.light.share, shares, atol=6e-4)
        assert CORRECTION in found.trace.done
        assert reconstructor.needs(frame).done[0] == CORRECTION


def test_a_corrected_image_is_measured_well_and_says_what_was_done(known, press):
    reconstructor = Reconstructor(known.calibration)
    still, changed = (
        reconstructor.depth(known.noisy(press.frame * np.float32(share)), uncertainty=True)
        for share in (1.0, 1.03)
    )
    assert changed.health.keys == ("exposure",)
    assert not changed.health.faults
    assert changed.findings and not changed.doubtful_findings
    found = with_map_findings(measure_heightmap(changed, shape="cylinder"), changed)
    assert found.verdict == "ok"
    assert found.height_mm == pytest.approx(1.0, abs=3.0 * found.sd["height_mm"])
    left = [
        reconstructor.misfit(known.noisy(press.frame * np.float32(share)), heightmap)
        for share, heightmap in ((1.0, still), (1.03, changed))
    ]
    assert np.nanmean(left[1]) == pytest.approx(np.nanmean(left[0]), rel=0.2)


def test_the_error_of_a_corrected_light_is_part_of_every_deviation(known, press):
    """What each channel's gain does to the height, if it is off by its standard deviation."""
    reconstructor, off, frame = Reconstructor(known.calibration), 0.005, known.noisy(press.frame)

    def height(share: Sequence[float], sd: float, *, uncertainty: bool = False) -> Measurement:
        light = LightGain(np.array(share), np.full(3, sd))
        found = reconstructor.depth(frame, uncertainty=uncertainty, health=FrameHealth(light=light))
        return measure_heightmap(found, shape="cylinder")

    usual = height((1.0, 1.0, 1.0), off, uncertainty=True)
    moved = [
        height([1.0 + off * (k == n) for n in range(3)], off).height_mm - usual.height_mm
        for k in range(3)
    ]
    # The fit leaves out walls that one light does not reach, where light moves depths most.
    assert 0.7 < usual.noise_sd["height_mm"] / np.linalg.norm(moved) < 2.0
    assert usual.sd["height_mm"] > usual.noise_sd["height_mm"]
    exact = height((1.0, 1.0, 1.0), 0.0, uncertainty=True)
    assert exact.noise_sd["height_mm"] < 0.2 * usual.noise_sd["height_mm"]


def test_light_as_at_calibration_changes_nothing(known, press):
    for model in ("full", "paper"):
        reconstructor = Reconstructor(known.calibration, model=model)
        for seed in range(2):
            found = reconstructor.depth(known.noisy(press.frame, seed=seed), normals=False)
            assert found.health.light is None
            assert CORRECTION in found.trace.skipped_names


def test_room_light_stays_a_fault(known, press):
    lit = press.frame * np.float32(1.02) + np.float32(0.002)
    found = Reconstructor(known.calibration).health(known.noisy(lit))
    assert [fault.key for fault in found.faults] == ["room_light"]
