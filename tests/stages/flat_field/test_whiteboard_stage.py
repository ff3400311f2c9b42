"""Light intensity from the whiteboard: correct despite dust and saturation."""

import numpy as np
import pytest
import scene

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS, RADIANCE
from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.geometry.refraction import camera_to_membrane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.rays import reflection
from gelpolight_core.stages.flat_field.whiteboard_stage import (
    LightIntensityResult,
    calibrate_radiance,
)

INDEX = scene.SENSOR.elastomer_refractive_index


def calibrated(image: LinearImage, leds_mm: np.ndarray = scene.LEDS) -> LightIntensityResult:
    """Return the light intensity of the small sensor."""
    return calibrate_radiance(image, scene.table(), leds_mm, elastomer_index=INDEX)


def whiteboard(vignetting: float = 0.1) -> np.ndarray:
    """Return a whiteboard image: intensity times cosine, with a fall-off towards the rim."""
    points = points_of_pixels()
    cosines, radiance = scene.flat_light(points)
    fall_off = 1.0 - vignetting * (points**2).sum(-1, keepdims=True) / 144.0
    return np.asarray(radiance * cosines * fall_off, np.float32)


def points_of_pixels() -> np.ndarray:
    """Return the point (rows, columns, 2) of the top surface that each pixel sees, in mm."""
    v, u = np.mgrid[: scene.CAMERA.height, : scene.CAMERA.width].astype(float)
    stack = scene.sensor_stack(scene.SENSOR, scene.PLANE)
    directions = scene.CAMERA.directions(np.stack([u, v], -1))
    return camera_to_membrane(directions, scene.PLANE, stack)[0]


def with_air(where: np.ndarray) -> np.ndarray:
    """Return a whiteboard image with air below a part of the board, and a little stray light."""
    cosines, _ = scene.flat_light(points_of_pixels())
    passed = 1.0 - reflection(INDEX * np.sqrt(1.0 - cosines**2), INDEX, 1.0)
    noise = 0.004 * np.random.default_rng(1).standard_normal(cosines.shape)
    board = whiteboard()
    lit = np.where(where[..., None], board * (0.98 * passed + 0.02), board)
    return np.asarray(np.clip(lit + noise, 0.0, 1.0), np.float32)


def measured(rgb: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, LightIntensityResult]:
    """Return the relative error (rows, columns, 3) of the light intensity, and the whole result."""
    table = scene.table()
    result = calibrated(LinearImage("whiteboard.png", rgb))
    points = table.grid.points_mm()
    _, radiance = scene.flat_light(points)
    fall_off = 1.0 - 0.1 * (points**2).sum(-1, keepdims=True) / 144.0
    return result.radiance / (scale * radiance * fall_off) - 1.0, result


def test_the_intensity_is_the_image_over_the_cosine():
    error, result = measured(whiteboard())
    assert result.usable[scene.table().valid].mean() > 0.85
    assert np.abs(error[result.usable]).max() < 0.005


def test_dust_and_scratches_do_not_darken_the_light():
    rgb = whiteboard()
    rgb[100:104, 60:260] *= 0.6
    rgb[60:66, 200:206] *= 0.3
    error, result = measured(rgb)
    assert np.abs(error[result.usable]).max() < 0.02


def test_saturated_areas_are_filled_by_the_law_of_light():
    scale = np.float32(1.0 / (0.8 * whiteboard().max()))
    error, result = measured(np.minimum(whiteboard() * scale, 1.0), float(scale))
    lost = result.saturated & result.usable
    assert lost.sum() > 500
    # The lost area extends to the rim, where only the trend determines the fall-off.
    assert np.abs(error[lost]).max() < 0.03


@pytest.mark.parametrize(
    ("rgb", "what"),
    [
        (whiteboard() * np.float32([1, 1, 0.01]), "blue channel is dark"),
        (np.minimum(whiteboard() * 8, 1).astype(np.float32), "saturated"),
    ],
)
def test_a_whiteboard_that_cannot_be_used_is_refused(rgb, what):
    with pytest.raises(InputError, match=what):
        calibrated(LinearImage("whiteboard.png", rgb))


@pytest.mark.parametrize("order", [[1, 0, 2], [2, 1, 0], [1, 2, 0]])
def test_leds_swapped_between_mirror_and_whiteboard_are_refused(order):
    image = LinearImage("whiteboard.png", whiteboard())
    with pytest.raises(InputError, match="is lit from the position of the"):
        calibrated(image, scene.LEDS[order])


def test_a_board_with_air_below_it_is_refused():
    everywhere = np.ones(points_of_pixels().shape[:2], np.bool_)
    with pytest.raises(
        InputError, match=r"not touch the gel \(dark beyond 45 degrees from each LED"
    ):
        calibrated(LinearImage("whiteboard.png", with_air(everywhere)))


@pytest.mark.parametrize("exponent", [-0.3, 1.5])
def test_an_air_bubble_is_measured_whatever_the_lobe_of_the_leds(exponent):
    """The board is dark farther from each LED by its lobe, too, but not from one mm to the next."""
    points = points_of_pixels()
    bubble = np.hypot(points[..., 0] - 6.0, points[..., 1]) < 3.0
    lobe = scene.flat_light(points)[0] ** exponent
    _, without = measured(np.float32(lobe * with_air(np.zeros_like(bubble))))
    _, with_bubble = measured(np.float32(lobe * with_air(bubble)))
    assert "whiteboard_gap_percent" not in [f.key for f in without.quality.figures]
    figure = with_bubble.quality["whiteboard_gap_percent"]
    assert figure.verdict is Verdict.WARN
    assert figure.value == pytest.approx(100.0 * (3.0 / 11.0) ** 2, rel=0.15)


def test_the_rendered_board_with_air_below_it(shared_data, rendered_optics):
    session = read_session(shared_data / "cases" / "air-gap")
    results = rendered_optics("sensor-A")
    results = run_stage(FULL, LIGHTS, read_session(shared_data / "sensor-A"), results)
    with pytest.raises(InputError, match="not touch the gel"):
        run_stage(FULL, RADIANCE, session, results)


@pytest.mark.parametrize("decibel", [40.0, 35.0, 30.0])
def test_noise_is_not_called_dust_and_a_speck_is(decibel):
    """Read noise is equal everywhere, so it is relatively largest where there is least light."""
    noise = 10.0 ** (-decibel / 20.0) * np.random.default_rng(4).standard_normal((240, 320, 3))
    clean, dirty = whiteboard(), whiteboard()
    dirty[60:66, 200:206] *= 0.3
    dirty[170:174, 80:100] *= 0.5
    shares = []
    for rgb in (clean, dirty):
        shown = np.clip(np.round(255.0 * (rgb + noise)) / 255.0, 0.0, 1.0)
        _, result = measured(shown.astype(np.float32))
        shares.append(result.quality["whiteboard_dust_percent"].value)
    assert shares[0] < 0.5
    assert shares[1] > shares[0] + 0.15
    assert result.dust.any()
