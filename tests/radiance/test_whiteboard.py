"""Light intensity from the whiteboard: right, and not led astray by dust or saturation."""

from __future__ import annotations

import numpy as np
import pytest
import scene

from gelpolight_core.errors import InputError
from gelpolight_core.optics.refraction import camera_to_membrane
from gelpolight_core.radiance.whiteboard import calibrate_radiance
from gelpolight_core.session.picture import Picture


def whiteboard(vignetting: float = 0.1) -> np.ndarray:
    """Return a whiteboard picture: intensity times cosine, with a fall-off towards the rim."""
    v, u = np.mgrid[: scene.CAMERA.height, : scene.CAMERA.width].astype(float)
    stack = scene.sensor_stack(scene.SENSOR, scene.PLANE)
    points, _ = camera_to_membrane(
        scene.CAMERA.directions(np.stack([u, v], -1)), scene.PLANE, stack
    )
    cosines, radiance = scene.flat_light(points)
    fall_off = 1.0 - vignetting * (points**2).sum(-1, keepdims=True) / 144.0
    return np.asarray(radiance * cosines * fall_off, np.float32)


def relative_error(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative error (rows, columns, 3) of the radiance, and the usable nodes."""
    table = scene.table()
    result = calibrate_radiance(Picture("whiteboard.png", rgb), table, scene.LEDS)
    points = table.grid.points_mm()
    _, radiance = scene.flat_light(points)
    fall_off = 1.0 - 0.1 * (points**2).sum(-1, keepdims=True) / 144.0
    return result.radiance / (radiance * fall_off) - 1.0, result.usable


def test_the_intensity_is_the_picture_over_the_cosine() -> None:
    error, usable = relative_error(whiteboard())
    assert usable[scene.table().valid].mean() > 0.85
    assert np.abs(error[usable]).max() < 0.005


def test_noise_is_smoothed_away() -> None:
    rgb = whiteboard() + np.random.default_rng(1).normal(0, 0.005, (240, 320, 3))
    error, usable = relative_error(rgb.astype(np.float32))
    assert np.sqrt((error[usable] ** 2).mean()) < 0.005


def test_dust_and_scratches_do_not_darken_the_light() -> None:
    rgb = whiteboard()
    rgb[100:104, 60:260] *= 0.6
    rgb[60:66, 200:206] *= 0.3
    error, usable = relative_error(rgb)
    assert np.abs(error[usable]).max() < 0.02


def test_saturated_places_are_filled_by_the_law_of_light() -> None:
    scale = np.float32(1.0 / (0.8 * whiteboard().max()))
    table = scene.table()
    result = calibrate_radiance(
        Picture("w", np.minimum(whiteboard() * scale, 1.0)), table, scene.LEDS
    )
    lost = result.saturated & result.usable
    assert lost.sum() > 500
    points = table.grid.points_mm()
    _, radiance = scene.flat_light(points)
    fall_off = 1.0 - 0.1 * (points**2).sum(-1, keepdims=True) / 144.0
    error = result.radiance / (scale * radiance * fall_off) - 1.0
    # What was lost reaches to the rim, where the fall-off is led by its trend alone.
    assert np.abs(error[lost]).max() < 0.03


def test_a_board_smaller_than_the_circle_ends_where_it_ends() -> None:
    rgb = whiteboard()
    rgb[:, 270:] = 0.0
    table = scene.table()
    result = calibrate_radiance(Picture("w", rgb), table, scene.LEDS)
    # Specks up to 15 nodes wide count as board, so the corners of its outline are rounded.
    assert not result.usable[table.u_px > 276].any()
    assert result.usable[(table.u_px < 250) & table.valid].mean() > 0.9


@pytest.mark.parametrize(
    ("rgb", "what"),
    [
        (whiteboard() * np.float32([1, 1, 0.01]), "blue channel is dark"),
        (np.minimum(whiteboard() * 8, 1).astype(np.float32), "saturated"),
    ],
)
def test_a_whiteboard_that_cannot_be_used_is_refused(rgb: np.ndarray, what: str) -> None:
    with pytest.raises(InputError, match=what):
        calibrate_radiance(Picture("whiteboard.png", rgb), scene.table(), scene.LEDS)


@pytest.mark.parametrize("order", [[1, 0, 2], [2, 1, 0], [1, 2, 0]])
def test_leds_that_the_mirror_shows_in_each_others_places_are_refused(order: list[int]) -> None:
    picture = Picture("whiteboard.png", whiteboard())
    with pytest.raises(InputError, match="is lit from where the mirror shows the"):
        calibrate_radiance(picture, scene.table(), scene.LEDS[order])
