"""Mirror spots and LED positions, on synthetic mirror images and on the rendered sessions."""

import json

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.session import read_session
from gelpolight_core.stages.leds.crosstalk import crosstalk_from_spots, unmix
from gelpolight_core.stages.leds.led_positions import locate_leds
from gelpolight_core.stages.leds.mirror_spots import find_mirror_spots

MATRIX = np.array([[1.0, 0.05, 0.02], [0.04, 1.0, 0.05], [0.03, 0.06, 1.0]])
CENTRES = np.array([[320.4, 401.7], [180.2, 160.9], [470.6, 150.3]])


def mirror_image(
    centres: np.ndarray = CENTRES,
    *,
    peak: float = 0.8,
    crosstalk: np.ndarray | None = None,
    noise: float = 0.002,
) -> np.ndarray:
    """Return a dark image (480, 640, 3) with one blurred disc per LED."""
    v, u = np.mgrid[:480, :640]
    light = np.zeros((480, 640, 3))
    for k, (cu, cv) in enumerate(centres):
        light[..., k] += peak * np.clip(3.0 - np.hypot(u - cu, v - cv) + 0.5, 0.0, 1.0)
    mixed = light if crosstalk is None else light @ crosstalk.T
    mixed = mixed + np.random.default_rng(3).normal(0.0, noise, mixed.shape)
    return np.asarray(np.round(np.clip(mixed, 0, 1) * 255) / 255, np.float32)


def add_spot(rgb: np.ndarray, centre: tuple[float, float], colour: tuple[float, ...]) -> np.ndarray:
    """Return the image with an additional disc of one colour."""
    v, u = np.mgrid[: rgb.shape[0], : rgb.shape[1]]
    disc = np.clip(3.5 - np.hypot(u - centre[0], v - centre[1]), 0.0, 1.0)
    return np.clip(rgb + disc[..., None] * np.array(colour), 0, 1).astype(np.float32)


def test_each_spot_is_found_in_its_own_colour_to_a_twentieth_of_a_pixel():
    spots = find_mirror_spots(LinearImage("mirror.png", mirror_image()))
    np.testing.assert_allclose(spots.centres_px, CENTRES, atol=0.05)


def test_crosstalk_moves_no_spot_and_is_measured():
    spots = find_mirror_spots(LinearImage("m", mirror_image(crosstalk=MATRIX, noise=0.0)))
    np.testing.assert_allclose(spots.centres_px, CENTRES, atol=0.05)
    found, _ = crosstalk_from_spots(spots)
    np.testing.assert_allclose(found, MATRIX, atol=0.005)
    light = np.array([[0.3, 0.5, 0.2]], np.float32)
    np.testing.assert_allclose(unmix((light @ MATRIX.T).astype(np.float32), MATRIX), light, 1e-5)


def test_a_faint_reflection_of_a_reflection_is_set_aside_with_its_reason():
    rgb = add_spot(mirror_image(), (100.0, 300.0), (0.2, 0.0, 0.0))
    spots = find_mirror_spots(LinearImage("m", rgb))
    np.testing.assert_allclose(spots.centres_px, CENTRES, atol=0.05)
    assert len(spots.rejected) == 1
    assert "red" in spots.rejected[0][1]


@pytest.mark.parametrize(
    ("rgb", "what"),
    [
        (np.zeros((480, 640, 3), np.float32), "black"),
        (np.full((480, 640, 3), 0.5, np.float32) * np.float32([1, 0.9, 0.8]), "bright"),
        (mirror_image() * np.float32([1, 0, 1]), "green LED has no spot"),
        (add_spot(mirror_image(), (90.0, 90.0), (0.0, 0.0, 0.7)), "2 blue spots"),
        (mirror_image(np.array([[320.0, 400.0], [180.0, 160.0], [181.5, 160.0]])), "merged"),
        (mirror_image(np.array([[320.0, 400.0], [180.0, 160.0], [638.0, 150.0]])), "border"),
    ],
)
def test_an_unusable_mirror_image_is_refused_with_the_reason(rgb, what):
    with pytest.raises(InputError, match=what) as refusal:
        find_mirror_spots(LinearImage("mirror_0.png", rgb))
    assert refusal.value.where == "mirror/mirror_0.png"
    assert refusal.value.advice


def test_saturated_spots_are_found_and_warned_of():
    spots = find_mirror_spots(LinearImage("m", mirror_image(peak=3.0)))
    np.testing.assert_allclose(spots.centres_px, CENTRES, atol=0.1)
    assert spots.quality["spot_peak"].verdict == "warn"
    np.testing.assert_allclose(crosstalk_from_spots(spots)[0], np.eye(3), atol=0.01)
    # Crosstalk is read off their flanks.
    mixed = mirror_image(peak=1.6, crosstalk=MATRIX, noise=0.0)
    found = crosstalk_from_spots(find_mirror_spots(LinearImage("m", mixed)))[0]
    np.testing.assert_allclose(found, MATRIX, atol=0.02)


@pytest.mark.function("Find the LEDs from their mirror images")
def test_leds_are_found_from_the_images_of_their_mirror_twins():
    """The mirror image of each LED is projected directly; the reflection is never computed here."""
    camera = CameraModel(640, 480, 690.0, 690.0, 320.0, 240.0)
    normal = np.array([0.02, -0.015, 1.0]) / np.linalg.norm([0.02, -0.015, 1.0])
    plane = TopPlane((float(normal[0]), float(normal[1]), float(normal[2])), 39.0)
    leds = np.array([[2.0, 11.0, -13.7], [-10.5, -4.0, -13.7], [9.5, -6.5, -13.7]])
    twins = plane.to_camera(leds * [1, 1, -1])
    found = find_mirror_spots(LinearImage("m", mirror_image(camera.project(twins))))
    result = locate_leds(found, camera, plane, led_height_mm=13.7)
    np.testing.assert_allclose(result.led_positions_mm, leds, atol=0.02)
    sd = np.sqrt(np.diagonal(result.led_covariance_mm2, axis1=1, axis2=2))
    assert (sd[:, 2] > 0.15).all(), "the housing's Z1 is known to 0.2 mm and dominates"


@pytest.mark.parametrize("sensor", ["sensor-A", "sensor-B"])
def test_the_rendered_mirror_is_read_to_a_tenth_of_a_pixel(shared_data, sensor):
    truth = json.loads((shared_data / sensor / "truth.json").read_text())
    c = truth["camera"]
    camera = CameraModel(1280, 960, c["fx"], c["fy"], c["cx"], c["cy"], (*c["k1_k2_p1_p2"], 0.0))
    normal = np.array(truth["top_plane"]["normal_camera"])
    plane = TopPlane(tuple(normal / np.linalg.norm(normal)), truth["top_plane"]["offset_mm"])
    leds = plane.to_sensor(np.array([truth["leds"][k]["camera_mm"] for k in "RGB"]))
    session = read_session(shared_data / sensor)
    spots = find_mirror_spots(session.averaged("mirror"))
    expected = camera.project(plane.to_camera(leds * [1, 1, -1]))
    np.testing.assert_allclose(spots.centres_px, expected, atol=0.1)
    found = locate_leds(spots, camera, plane, led_height_mm=session.sensor.led_height_mm)
    error = found.led_positions_mm - leds
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.15
    assert np.linalg.norm(error, axis=1).max() < 0.35
    truth_matrix = np.array(truth["crosstalk_camera_from_led"])
    np.testing.assert_allclose(crosstalk_from_spots(spots)[0], truth_matrix, atol=0.005)


@pytest.mark.parametrize("where", ["darkness", "another spot"])
def test_a_spot_dragged_where_its_led_does_not_shine_fails(where):
    image = LinearImage("m", mirror_image())
    found = find_mirror_spots(image)
    assert found.quality["spot_light"].verdict is Verdict.PASS
    place = (20.0, 20.0) if where == "darkness" else found.spots[1].centre_px
    figure = find_mirror_spots(image, placed={0: place}).quality["spot_light"]
    assert figure.verdict is Verdict.FAIL
    kept = find_mirror_spots(image, placed={0: found.spots[0].centre_px}).quality
    assert kept["spot_light"] == found.quality["spot_light"]
