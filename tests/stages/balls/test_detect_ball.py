"""Balls are found on gels of all kinds, and nothing else is taken for a ball."""

import csv
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.stages.balls.ball_detection import BallDetection, detect_ball, find_indentation
from gelpolight_core.stages.balls.indentation_checks import BallRefusalReason
from tests.stages.balls.test_indentation import HEIGHT, WIDTH, read_rgb, scene, shade

Image = NDArray[np.float32]
Array = NDArray[np.float64]


def dots(pitch: float, diameter: float, press: tuple[float, float, float] | None) -> Array:
    """Return the reflectance of a printed grid; a press pushes its dots outwards."""
    y, x = np.indices((HEIGHT, WIDTH), dtype=np.float64)
    if press is not None:
        cx, cy, radius = press
        r = np.hypot(x - cx, y - cy) + 1e-9
        push = 0.12 * r * np.exp(-((r / (1.3 * radius)) ** 2))
        x, y = x - push * (x - cx) / r, y - push * (y - cy) / r
    away = np.hypot(x % pitch - pitch / 2.0, y % pitch - pitch / 2.0)
    return np.asarray(1.0 - 0.8 / (1.0 + np.exp((away - diameter / 2.0) / 0.5)))


def marked_scene(
    press: tuple[float, float, float], *, pitch: float, diameter: float, seed: int = 0
) -> tuple[Image, Image]:
    """Return a press on a gel with printed dots that move with the membrane, and its background."""
    image, background = scene(press, seed=seed)
    moved = image * dots(pitch, diameter, press)[..., None]
    still = background * dots(pitch, diameter, None)[..., None]
    return moved.astype(np.float32), still.astype(np.float32)


def off(found: BallDetection, x: float, y: float) -> float:
    assert found.indentation is not None, found.refusal
    return float(np.hypot(found.indentation.centre[0] - x, found.indentation.centre[1] - y))


# -- gels with markers --------------------------------------------------------------------------


@pytest.mark.parametrize(("pitch", "diameter"), [(20.0, 6.0), (30.0, 10.0)])
def test_balls_are_found_among_printed_dots(pitch, diameter):
    errors, in_sd = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        press = (rng.uniform(80, 240), rng.uniform(80, 160), rng.uniform(22, 45))
        found = detect_ball(*marked_scene(press, pitch=pitch, diameter=diameter, seed=seed))
        assert found.reason is BallRefusalReason.OK, found.refusal
        errors.append(off(found, press[0], press[1]))
        in_sd.append(errors[-1] < 3.0 * found.indentation.centre_sd_px)
    # Without leaving the dots out it is 8 px and more.
    assert np.median(errors) < 1.5
    assert max(errors) < 5.0
    assert np.mean(in_sd) >= 0.9


# -- what is known of the uncertainty -------------------------------------------------------------


def test_stated_uncertainty_covers_the_error_of_noisy_and_textured_presses():
    held = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x, y, radius = rng.uniform(80, 240), rng.uniform(80, 160), rng.uniform(20, 50)
        grain = 1.0 + 0.3 * cv2.GaussianBlur(rng.standard_normal((HEIGHT, WIDTH)), (0, 0), 2.0)
        noise = float(rng.choice([0.003, 0.01, 0.03]))
        found = detect_ball(*scene((x, y, radius), noise=noise, seed=seed, reflectance=grain))
        held.append(off(found, x, y) < 3.0 * found.indentation.centre_sd_px)
    assert np.mean(held) >= 0.9


# -- balls at the border, several balls, none ----------------------------------------------------


@pytest.mark.parametrize(("x", "verdict"), [(18.0, Verdict.PASS), (-6.0, Verdict.WARN)])
def test_ball_cut_by_the_border_is_named_and_warns_where_its_centre_is_unsure(x, verdict):
    image, background = scene((x, 120.0, 35.0))
    found = detect_ball(image, background)
    assert found.reason is BallRefusalReason.CUT
    assert found.indentation.quality.verdict is verdict
    assert off(found, x, 120.0) < 3.0 * found.indentation.centre_sd_px
    with pytest.raises(InputError, match="border cuts"):
        find_indentation(image, background)


@pytest.mark.parametrize("apart", [30.0, 55.0])
def test_two_touching_balls_do_not_pass(apart):
    found = detect_ball(*scene((120.0, 120.0, 30.0), (120.0 + apart, 120.0, 30.0)))
    assert found.indentation is None or found.indentation.quality.verdict is not Verdict.PASS


def test_contact_much_larger_than_the_stated_ball_is_refused():
    image, background = scene((150.0, 120.0, 45.0))
    assert detect_ball(image, background, ball_radius_px=82.0).reason is BallRefusalReason.OK
    assert detect_ball(image, background, ball_radius_px=20.0).reason is not BallRefusalReason.OK


def test_an_image_that_cannot_be_used_is_an_answer_and_no_exception():
    image, background = scene((150.0, 120.0, 35.0))
    for bad in (np.zeros_like(image), np.ones_like(image), image[:, :300]):
        found = detect_ball(bad, background)
        assert found.reason is BallRefusalReason.UNUSABLE_IMAGE
        assert found.indentation is None


# -- things that are not balls --------------------------------------------------------------------


def _polygon(corners: int) -> Array:
    turn = np.arange(corners) / corners * 2.0 * np.pi
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def _flat_thing(parts: list[tuple[Array, float]]) -> Array:
    """Return a flat face of drawn parts (corners in units of its size, height)."""
    rng = np.random.default_rng(len(parts) + len(parts[0][0]))
    face = np.zeros((HEIGHT, WIDTH), np.float32)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    rotate = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    for corners, height in parts:
        at = np.rint((corners @ rotate * 45.0 + [160.0, 120.0]) * 16.0).astype(np.int32)
        cv2.fillPoly(face, [at], height, shift=4)
    return np.asarray(6.0 * face, np.float64)


def _bar(length: float, width: float) -> Array:
    return np.array([(-length, -width), (length, -width), (length, width), (-length, width)])


def _solid(name: str) -> Array:
    y, x = np.indices((HEIGHT, WIDTH), dtype=np.float64)
    u, v = (x - 150.0) / 40.0, (y - 115.0) / 40.0
    if name == "rod":
        return 15.0 * np.sqrt(np.maximum(0.36 - v * v, 0.0)) * (np.abs(u) < 1.4)
    if name == "thread":
        ridges = 0.75 + 0.25 * np.cos(18.0 * u + 2.0 * v)
        return 15.0 * np.sqrt(np.maximum(0.36 - v * v, 0.0)) * (np.abs(u) < 1.4) * ridges
    if name == "edge":
        return 6.0 * np.clip(1.0 - 3.0 * np.abs(v), 0.0, 1.0) * (np.abs(u) < 1.5)
    return 8.0 * np.sqrt(np.maximum(1.0 - (u**4 + v**4), 0.0))


THINGS = {
    **{f"polygon of {n}": _flat_thing([(_polygon(n), 1.0)]) for n in (3, 5, 8)},
    "coin": _flat_thing([(_polygon(60), 1.0), (0.85 * _polygon(60), 0.7)]),
    "nut": _flat_thing([(_polygon(6), 1.0), (0.5 * _polygon(40), 0.0)]),
    "screw head": _flat_thing(
        [(_polygon(60), 1.0), (_bar(0.9, 0.12), 0.0), (_bar(0.12, 0.9), 0.0)]
    ),
    "key": _flat_thing(
        [
            (0.6 * _polygon(40) - np.array([0.9, 0.0]), 1.0),
            (_bar(1.2, 0.2) + np.array([0.3, 0.0]), 1.0),
        ]
    ),
    **{name: _solid(name) for name in ("rod", "thread", "edge", "domed cube")},
}


def pressed(thing: str) -> tuple[Image, Image]:
    """Return an image of an object and its background."""
    # The membrane rounds every edge off and hangs down around the object.
    depth = cv2.GaussianBlur(THINGS[thing], (0, 0), 2.0)
    depth = np.maximum(depth, 0.65 * cv2.GaussianBlur(depth, (0, 0), 7.0))
    depth = cv2.GaussianBlur(depth, (0, 0), 1.2)
    slope_y, slope_x = np.gradient(depth)
    flat = np.zeros_like(depth)
    background = shade(flat, flat, flat)
    rng = np.random.default_rng(1)
    image, empty = (
        (0.8 * light / background.max() + 0.004 * rng.standard_normal(light.shape))
        for light in (shade(depth, slope_x, slope_y), background)
    )
    return image.astype(np.float32), empty.astype(np.float32)


@pytest.mark.parametrize("thing", THINGS)
def test_other_objects_are_no_balls(thing):
    found = detect_ball(*pressed(thing))
    assert found.indentation is None
    assert found.reason in {
        BallRefusalReason.FLAT,
        BallRefusalReason.NOT_ROUND,
        BallRefusalReason.NOT_A_BALL,
        BallRefusalReason.TOO_SMALL,
    }


def test_markers_are_named_where_they_hide_what_is_pressed():
    print_of_dots = dots(18.0, 12.0, None)[..., None].astype(np.float32)
    image, background = (light * print_of_dots for light in pressed("coin"))
    found = detect_ball(image, background)
    assert found.reason is BallRefusalReason.MARKERS
    assert "markers" in found.refusal.found


@pytest.mark.parametrize("sensor", ["sensor-A", pytest.param("sensor-C", marks=pytest.mark.long)])
def test_rendered_cylinders_and_cuboids_are_no_balls(shared_data, sensor):
    background = read_rgb(shared_data / sensor / "background" / "background.png")
    for file in sorted((shared_data / sensor / "presses").glob("*.png"))[::4]:
        assert detect_ball(read_rgb(file), background).indentation is None, file.name


# -- real gels, with a person's circles -----------------------------------------------------------


@dataclass(frozen=True)
class Goal:
    """What is asked of a set: share found, error against the label, share within 3 sd."""

    found: float
    median_px: float
    p90_px: float
    within_3_sd: float


# The labels are 2 px off in x and 1.4 px in y themselves. On the DIGIT the shading's middle and
# the person's circle lie apart by a smooth shift of up to 15 px over the gel, which has no edge
# free of shadows; what is asked there is that the stated uncertainty covers it.
GOALS = {
    "mini-1": Goal(0.95, 2.5, 4.5, 0.85),
    "wedge-1": Goal(0.98, 2.6, 5.5, 0.9),
    "digit-1": Goal(0.95, 9.0, 16.0, 0.85),
}


def labelled(folder: Path) -> Iterator[tuple[Image, float, float, float]]:
    """Return every third labelled image of a set, with its circle and the ball's radius."""
    session = tomllib.loads((folder / "session.toml").read_text(encoding="utf-8"))
    scale = session["in_place"]["mm_per_px"]
    with (folder / "labels.csv").open(encoding="utf-8") as table:
        for row in [row for row in csv.DictReader(table) if row["x_px"]][::3]:
            image = read_rgb(folder / "balls" / row["file"])
            radius_px = float(row["ball_radius_mm"]) / scale
            yield image, float(row["x_px"]), float(row["y_px"]), radius_px


@pytest.mark.parametrize(
    "name",
    ["mini-1", *(pytest.param(name, marks=pytest.mark.long) for name in ("wedge-1", "digit-1"))],
)
def test_real_balls_are_found_where_a_person_sees_them(shared_data, name):
    folder = shared_data / "real" / "closed" / name
    background = read_rgb(folder / "background" / "background.png")
    errors, held, count = [], [], 0
    passed = 0
    for image, x, y, radius_px in labelled(folder):
        count += 1
        found = detect_ball(image, background, ball_radius_px=radius_px)
        if found.indentation is not None:
            passed += found.indentation.quality.verdict is Verdict.PASS
            errors.append(off(found, x, y))
            held.append(errors[-1] < 3.0 * found.indentation.centre_sd_px)
    goal = GOALS[name]
    assert len(errors) >= goal.found * count
    assert np.median(errors) <= goal.median_px
    assert np.quantile(errors, 0.9) <= goal.p90_px
    assert np.mean(held) >= goal.within_3_sd
    # The calibration uses all of them, and none is left out as an outlier.
    assert passed >= 0.85 * count
