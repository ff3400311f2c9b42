"""Light intensity from the whiteboard: correct despite dust and saturation."""

import numpy as np
import pytest
import scene

from gelpolight_core.base.errors import InputError
from gelpolight_core.geometry.refraction import camera_to_membrane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.stages.flat_field.whiteboard_stage import (
    LightIntensityResult,
    calibrate_radiance,
)


def whiteboard(vignetting: float = 0.1) -> np.ndarray:
    """Return a whiteboard image: intensity times cosine, with a fall-off towards the rim."""
    v, u = np.mgrid[: scene.CAMERA.height, : scene.CAMERA.width].astype(float)
    stack = scene.sensor_stack(scene.SENSOR, scene.PLANE)
    points, _ = camera_to_membrane(
        scene.CAMERA.directions(np.stack([u, v], -1)), scene.PLANE, stack
    )
    cosines, radiance = scene.flat_light(points)
    fall_off = 1.0 - vignetting * (points**2).sum(-1, keepdims=True) / 144.0
    return np.asarray(radiance * cosines * fall_off, np.float32)


def measured(rgb: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, LightIntensityResult]:
    """Return the relative error (rows, columns, 3) of the light intensity, and the whole result."""
    table = scene.table()
    result = calibrate_radiance(LinearImage("whiteboard.png", rgb), table, scene.LEDS)
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
        calibrate_radiance(LinearImage("whiteboard.png", rgb), scene.table(), scene.LEDS)


@pytest.mark.parametrize("order", [[1, 0, 2], [2, 1, 0], [1, 2, 0]])
def test_leds_swapped_between_mirror_and_whiteboard_are_refused(order):
    image = LinearImage("whiteboard.png", whiteboard())
    with pytest.raises(InputError, match="is lit from the position of the"):
        calibrate_radiance(image, scene.table(), scene.LEDS[order])


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
