"""A ball's indentation is found by itself, or refused with a reason a person can act on."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Verdict
from gelpolight_core.image.scaled_difference import pixel_noise
from gelpolight_core.stages.balls.ball_detection import find_indentation
from gelpolight_core.stages.balls.contact_contour import ImageCircle, dilution
from gelpolight_core.stages.balls.indentation import Indentation

Images = tuple[NDArray[np.float32], NDArray[np.float32]]
Array = NDArray[np.float64]
WIDTH, HEIGHT = 320, 240


def surface(
    presses: list[tuple[float, float, float]], *, drape_px: float, contact_over_ball: float
) -> tuple[NDArray[np.float64], ...]:
    """Return depth and slopes of balls that the membrane leaves along a tangent."""
    y, x = np.indices((HEIGHT, WIDTH), dtype=np.float64)
    depth, slope_x, slope_y = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for cx, cy, contact in presses:
        ball = contact / contact_over_ball
        r = np.hypot(x - cx, y - cy)
        edge_height = np.sqrt(ball**2 - contact**2)
        fall = np.exp(-np.maximum(r - contact, 0.0) / drape_px)
        ball_height = np.sqrt(np.maximum(ball**2 - np.minimum(r, contact) ** 2, 0.0))
        slope = np.where(r < contact, r / ball_height, contact / edge_height * fall)
        depth += contact / edge_height * drape_px * fall + ball_height - edge_height
        slope_x -= slope * (x - cx) / np.maximum(r, 1e-9)
        slope_y -= slope * (y - cy) / np.maximum(r, 1e-9)
    return depth, slope_x, slope_y


def shade(
    depth: NDArray[np.float64], slope_x: NDArray[np.float64], slope_y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a Lambertian membrane under three point lights, one per channel, with shadows."""
    y, x = np.indices(depth.shape, dtype=np.float64)
    steep = np.sqrt(1.0 + slope_x**2 + slope_y**2)
    height = 140.0
    light = []
    for angle in np.deg2rad([90.0, 210.0, 330.0]):
        dx = WIDTH / 2 + 140.0 * np.cos(angle) - x
        dy = HEIGHT / 2 + 140.0 * np.sin(angle) - y
        dz = height - depth
        distance = np.sqrt(dx**2 + dy**2 + dz**2)
        cosine = np.maximum(dz - slope_x * dx - slope_y * dy, 0.0) / (steep * distance)
        lit = np.ones_like(depth)
        for step in np.linspace(0.02, 0.3, 15):
            over = cv2.remap(
                depth.astype(np.float32),
                (x + step * dx).astype(np.float32),
                (y + step * dy).astype(np.float32),
                cv2.INTER_LINEAR,
            )
            lit *= over <= depth + step * dz + 0.1
        light.append(cosine * (height / distance) ** 2 * cv2.GaussianBlur(lit, (0, 0), 0.7))
    return np.stack(light, axis=2)


def scene(
    *presses: tuple[float, float, float],
    noise: float = 0.003,
    seed: int = 0,
    drape_px: float = 12.0,
    contact_over_ball: float = 0.55,
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0),
    reflectance: NDArray[np.floating] | float = 1.0,
) -> Images:
    """Return an 8-bit image of presses (x, y, contact radius), and its background."""
    rng = np.random.default_rng(seed)
    flat = np.zeros((HEIGHT, WIDTH))
    factor = np.broadcast_to(np.asarray(reflectance), flat.shape)[..., None]
    background = shade(flat, flat, flat)
    exposure = 0.8 / background.max()
    form = surface(list(presses), drape_px=drape_px, contact_over_ball=contact_over_ball)
    pressed = shade(*form) * np.array(gain)
    taken = []
    for image in (pressed, background):
        signal = exposure * image * factor + noise * rng.standard_normal(image.shape)
        taken.append((np.rint(255.0 * np.clip(signal, 0.0, 1.0)) / 255.0).astype(np.float32))
    return taken[0], taken[1]


def off_by(found: Indentation, x: float, y: float) -> float:
    return float(np.hypot(found.centre[0] - x, found.centre[1] - y))


def refusal(press: NDArray[np.float32], background: NDArray[np.float32]) -> InputError:
    with pytest.raises(InputError) as caught:
        find_indentation(press, background, name="ball_07.png")
    assert "ball_07.png" in caught.value.where
    assert caught.value.advice
    return caught.value


# -- what is found ------------------------------------------------------------------------------


@settings(max_examples=6, deadline=None)
@given(
    x=st.floats(75.0, 245.0),
    y=st.floats(75.0, 165.0),
    radius=st.floats(12.0, 65.0),
    noise=st.sampled_from([0.003, 0.01]),
    seed=st.integers(0, 1000),
)
def test_centre_and_radius_of_any_clear_press(x, y, radius, noise, seed):
    found = find_indentation(*scene((x, y, radius), noise=noise, seed=seed))
    # 1.5 px of a contact of 30 px is 1.6 degrees of slope at 0.55: what the shading refines.
    assert off_by(found, x, y) < 1.5
    assert found.contact_radius_px == pytest.approx(radius, abs=1.5)
    assert found.quality.verdict is not Verdict.FAIL


def test_quiet_image_gives_a_tenth_of_a_pixel():
    found = find_indentation(*scene((141.3, 118.8, 40.0)))
    assert off_by(found, 141.3, 118.8) < 0.25
    assert found.contact_radius_px == pytest.approx(40.0, abs=0.4)
    assert found.centre_sd_px < 0.25
    assert found.quality["axis_ratio"].value > 0.97


def test_heavy_noise_still_gives_the_place_and_admits_doubt():
    clear = find_indentation(*scene((150.0, 110.0, 45.0)))
    noisy = find_indentation(*scene((150.0, 110.0, 45.0), noise=0.0316))
    # 30 dB: a twentieth of the radius is what the refinement on the shading can start from.
    assert off_by(noisy, 150.0, 110.0) < 4.5
    assert noisy.centre_sd_px > clear.centre_sd_px
    assert noisy.noise == pytest.approx((0.0447,) * 3, rel=0.15)
    key = "signal_to_noise"
    assert noisy.quality[key].value < clear.quality[key].value


@settings(max_examples=5, deadline=None)
@given(gains=st.tuples(*[st.floats(0.9, 1.1)] * 3))
def test_small_changes_of_the_light_are_measured_and_taken_out(gains):
    found = find_indentation(*scene((150.0, 120.0, 35.0), gain=gains))
    assert off_by(found, 150.0, 120.0) < 0.5
    most = 100.0 * max(abs(gain - 1.0) for gain in gains)
    assert found.quality["gain_change"].value == pytest.approx(most, abs=1.0)


@pytest.mark.parametrize("share", [0.4, 0.5, 0.7, 1.0])
def test_an_arc_gives_its_centre_as_much_worse_as_is_stated(share):
    """Centres of circles through noisy arcs scatter as the part of the edge in view says."""
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 2.0 * np.pi * share, round(180 * share), endpoint=False)
    design = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    radii = 40.0 + 0.5 * rng.standard_normal((len(angle), 4000))
    centres = np.linalg.lstsq(design, radii, rcond=None)[0][1:]
    worst = float(np.sqrt(np.linalg.eigvalsh(np.cov(centres)).max()))
    stated = (
        0.5 * np.sqrt(2.0 / len(angle)) * dilution(40.0 * design[:, 1:], ImageCircle(0.0, 0.0, 40))
    )
    assert stated == pytest.approx(worst, rel=0.05)


# -- what is refused ----------------------------------------------------------------------------


def test_two_presses_are_refused():
    error = refusal(*scene((90.0, 100.0, 30.0), (220.0, 140.0, 30.0)))
    assert "more than one" in error.found
    assert error.advice == Remedy.ONE_BALL


def test_contact_cut_by_the_working_area_is_refused():
    press, background = scene((120.0, 120.0, 35.0))
    rows, columns = np.indices((HEIGHT, WIDTH))
    disc = np.hypot(columns - 190.0, rows - 120.0) < 80.0
    with pytest.raises(InputError, match="border cuts"):
        find_indentation(press, background, valid=disc)
    dark = np.where(disc[..., None], press, 0.0), np.where(disc[..., None], background, 0.0)
    with pytest.raises(InputError, match="border cuts"):
        find_indentation(*dark)


@pytest.mark.parametrize("gain", [(0.6, 0.6, 0.6), (1.0, 1.0, 0.02), (1.0, 1.4, 1.0)])
def test_large_changes_of_the_light_are_refused(gain):
    assert "times as bright" in refusal(*scene((150.0, 120.0, 35.0), gain=gain)).found


def test_colours_in_another_order_are_refused():
    press, background = scene((150.0, 120.0, 35.0))
    error = refusal(np.ascontiguousarray(press[..., ::-1]), background)
    assert "bright" in error.found or "light changed" in error.found


def stretched(images: Images, factor: float) -> Images:
    """Return images whose height is stretched about the middle."""
    move = np.array([[1.0, 0.0, 0.0], [0.0, factor, HEIGHT / 2 * (1.0 - factor)]])
    border = cv2.BORDER_REPLICATE
    press, background = (
        cv2.warpAffine(p, move, (WIDTH, HEIGHT), borderMode=border).astype(np.float32)
        for p in images
    )
    return press, background


def test_oval_contact_is_refused_and_a_slightly_oval_one_is_not():
    images = scene((160.0, 120.0, 40.0))
    assert "round" in refusal(*stretched(images, 1.45)).found
    found = find_indentation(*stretched(images, 1.1))
    assert found.quality["axis_ratio"].value == pytest.approx(1.0 / 1.1, abs=0.03)


# -- noise --------------------------------------------------------------------------------------


@given(sigma=st.floats(0.005, 0.05), seed=st.integers(0, 100))
@settings(max_examples=10, deadline=None)
def test_noise_is_measured_through_shading_and_edges(sigma, seed):
    rng = np.random.default_rng(seed)
    y, x = np.indices((200, 200)) / 200.0
    image = np.stack([x, x * y, np.where(x > 0.5, 1.0, 0.0)], axis=2)
    noisy = (image + sigma * rng.standard_normal(image.shape)).astype(np.float32)
    everywhere = np.ones((200, 200), dtype=np.bool_)
    # The median of 20 000 blocks is known to 1 %.
    assert pixel_noise(noisy, everywhere) == pytest.approx((sigma,) * 3, rel=0.05)


# -- images of others -------------------------------------------------------------------------


def read_rgb(path: Path) -> NDArray[np.float32]:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert image is not None, path
    return np.ascontiguousarray(image[..., ::-1], dtype=np.float32) / np.float32(255.0)


@pytest.mark.parametrize("sensor", ["sensor1", "sensor2"])
def test_sensor_that_measures_by_darkness_is_answered(shared_data, sensor):
    folder = shared_data / "real" / "9dtact"
    background = read_rgb(folder / f"{sensor}_depth_calibration_ref.png")
    found = find_indentation(
        read_rgb(folder / f"{sensor}_depth_calibration_sample.png"), background
    )
    assert found.quality["axis_ratio"].value > 0.9
    with pytest.raises(InputError, match="more than one"):
        find_indentation(
            read_rgb(folder / f"{sensor}_camera_calibration_sample.png"),
            read_rgb(folder / f"{sensor}_camera_calibration_ref.png"),
        )
