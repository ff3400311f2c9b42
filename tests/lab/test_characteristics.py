"""Characteristics after ISO 25178-600: each against a map, a response or a sensor that is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.characteristics import (
    HALF_RESPONSE,
    Characteristic,
    characteristics,
    flat_maps,
)
from gelpolight_core.lab.reference_press import ReferencePress, read_truth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import write_image
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.exact_sensor import known_sensor
from tests.lab.test_evaluation import press
from tests.measurement.maps import measurement


@pytest.fixture(scope="module")
def known():
    return known_sensor(SensorDesign().scaled(0.25))


def by_key(
    results: list[ReferencePress], flat: tuple[np.ndarray, ...] = ()
) -> dict[str, Characteristic]:
    return {found.key: found for found in characteristics(results, flat)}


def test_noise_and_flatness_of_known_maps():
    rng = np.random.default_rng(0)
    y, x = np.mgrid[-1.0:1.0:80j, -1.0:1.0:100j]
    dome_um = 3.0 * (x**2 + y**2)  # 6 um from the middle to the corners
    tilted = dome_um + 20.0 * x - 7.0 * y + 5.0
    maps = [tilted + rng.normal(0.0, 0.2, x.shape) for _ in range(40)]
    maps[0][:3], maps[5][:3] = np.nan, np.nan
    found = by_key([], tuple(np.where(np.isnan(maps[0]), np.nan, one) for one in maps))
    noise, flat = found["measurement_noise_um"], found["flatness_deviation_um"]
    assert abs(noise.value - 0.2) < noise.expanded + 0.002
    assert abs(flat.value - 6.0) < 0.3 and 0.0 < flat.expanded < 0.2


def test_two_images_are_one_too_few_and_nothing_is_made_up():
    flat = np.random.default_rng(1).normal(size=(2, 8, 8))
    for found in by_key([press("cylinder", 5.0, 1.0)], tuple(flat)).values():
        assert found.needed and math.isnan(found.value) and math.isnan(found.expanded)
        assert found.as_json()["value"] is None
    assert by_key([], tuple(flat))["measurement_noise_um"].needed.startswith("1 ")


@pytest.mark.function("See noise, flatness, amplification, linearity and resolution of a sensor")
def test_amplification_and_linearity_of_a_known_response():
    rng = np.random.default_rng(2)
    held = []
    for _ in range(200):
        results = []
        for size, height in [(3.0, 1.0), (5.0, 0.5), (5.0, 1.0), (5.0, 1.5), (7.0, 1.25)]:
            seen = measurement(
                "cylinder", 1.01 * size, 0.02 + 0.98 * height + rng.normal(0.0, 0.002)
            )
            results.append(replace(press("cylinder", size, height), outcome=seen))
        found = by_key(results)
        slope = found["amplification_z_percent"]
        held.append(abs(slope.value + 2.0) < slope.expanded)
    assert np.mean(held) == pytest.approx(0.954, abs=0.04)
    assert found["amplification_xy_percent"].value == pytest.approx(1.0)
    assert found["linearity_deviation_xy_um"].value == pytest.approx(0.0, abs=1e-6)
    bent = [
        replace(press("cylinder", 5.0, h), outcome=measurement("cylinder", 5.0, h + 0.04 * h * h))
        for h in (0.5, 1.0, 1.5)
    ]
    # Of a parabola 0.04 h**2 at three points, the middle lies 2/3 of 10 um below the line.
    known = by_key(bent)["linearity_deviation_z_um"]
    assert known.value == pytest.approx(20.0 / 3.0, abs=1e-6)


def test_the_mapping_deviation_is_that_of_the_one_shifted_position(tmp_path):
    places = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (-4.0, 0.0), (0.0, -4.0), (3.0, 3.0)]
    turned = np.exp(0.3j)
    lines = ["file,shape,diameter_mm,height_mm,x_mm,y_mm,position_sd_mm"]
    lines += [f"{k}.png,cylinder,5,1,{x},{y},0.005" for k, (x, y) in enumerate(places)]
    (tmp_path / "truth.csv").write_text("\n".join(lines))
    results = []
    for row in read_truth(tmp_path).rows:
        at = complex(*row.position_mm) * turned + (1.0 - 2.0j)
        if row.file == "0.png":
            at += 0.06
        seen = replace(measurement("cylinder", 5.0, 1.0), centre_mm=(at.real, at.imag))
        results.append(replace(row, outcome=seen))
    found = by_key(results)["mapping_deviation_xy_um"]
    # A sixth of the shift goes into the translation.
    assert found.value == pytest.approx(50.0, abs=2.0) and found.expanded > 10.0
    assert "4 " in by_key([replace(results[0], position_sd_mm=None)])[found.key].needed
    (tmp_path / "truth.csv").write_text(lines[0] + "\n0.png,cylinder,5,1,nan,2,0.01")
    with pytest.raises(InputError, match="x_mm"):
        read_truth(tmp_path)


def test_a_sine_of_the_period_limit_keeps_half_its_height():
    blur_mm, pitch_mm = 0.05, 0.005
    outcome = replace(measurement("cylinder", 5.0, 1.0), blur_mm=blur_mm)
    limit = by_key([replace(press("cylinder", 5.0, 1.0), outcome=outcome)] * 3)
    period_mm = limit["lateral_period_limit_mm"].value
    assert period_mm == pytest.approx(HALF_RESPONSE * blur_mm)
    wave = np.sin(2.0 * np.pi * np.arange(0.0, 50.0 * period_mm, pitch_mm) / period_mm)
    blurred = gaussian_filter1d(wave, blur_mm / pitch_mm)
    assert np.ptp(blurred[1000:-1000]) / 2.0 == pytest.approx(0.5, abs=0.005)


@pytest.mark.parametrize(("share", "kept"), [(0.88, False), (1.12, True)])
def test_a_sensor_shows_a_wave_as_its_period_limit_says(known, share, kept):
    sensor = Reconstructor(known.calibration)
    image = known.noisy(known.pressed(CylinderIndenter(5.0, 1.0, 0.08), x_mm=0.5, y_mm=0.3).frame)
    seen = measure_heightmap(sensor.depth(image, uncertainty=True), shape="cylinder")
    limit = by_key([replace(press("cylinder", 5.0, 1.0), outcome=seen)] * 3)
    period_mm = share * limit["lateral_period_limit_mm"].value
    nodes = np.arange(-4.0, 4.0, 0.0125)
    x, y = np.meshgrid(nodes, nodes)
    face = 1.0 / (1.0 + np.exp(10.0 * (np.hypot(x, y) - 3.0)))

    def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        phase = 2.0 * np.pi * (x * np.cos(0.3) + y * np.sin(0.3)) / period_mm
        return np.stack([np.sin(phase), np.cos(phase)])

    height_mm = 0.02 * period_mm
    depth = face * (0.2 + height_mm * wave(x, y)[0])
    surface = PressedSurface(depth, face > 0.5, nodes[0], nodes[0], nodes[1] - nodes[0])
    found = sensor.depth(known.noisy(known.showing(surface).frame), everywhere=True)
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    middle = np.hypot(x, y) < 2.0
    x, y = x[middle], y[middle]
    parts = np.stack([np.ones_like(x), x, y, x * x, y * y, *wave(x, y)], axis=1)
    solved = np.linalg.lstsq(parts, found.depth_mm[middle], rcond=None)[0]
    assert bool(np.hypot(*solved[-2:]) > 0.5 * height_mm) is kept


def test_the_noise_of_a_sensor_is_what_its_maps_state(known, tmp_path):
    sensor = Reconstructor(known.calibration)
    (tmp_path / "flat").mkdir()
    for seed in range(5):
        write_image(known.noisy(known.bare(), seed=seed), tmp_path / "flat" / f"{seed}.png")
    maps = flat_maps(sensor, tmp_path)
    found = by_key([], maps)["measurement_noise_um"]
    noisy = sensor.depth(known.noisy(known.bare()), everywhere=True, uncertainty=True)
    assert noisy.depth_sd_mm is not None
    stated_um = 1e3 * float(np.sqrt(np.mean(noisy.depth_sd_mm[np.isfinite(maps[0])] ** 2)))
    assert found.value == pytest.approx(stated_um, rel=0.35)
    assert 0.0 < found.expanded < found.value
