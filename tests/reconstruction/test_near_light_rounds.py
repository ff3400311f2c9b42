"""The near-light rounds: they settle, are damped where they would leap, and say so."""

import cv2
import numpy as np
import pytest
from compiled import ShadedField, field_of, full_model, solve
from numpy.typing import NDArray

from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.near_light import damped_rounds
from gelpolight_core.sensor.sensor_calibration import FullModel

Array = NDArray[np.float64]
PITCH = 0.16
X = -12.0 + PITCH * np.arange(152)
Y = -11.0 + PITCH * np.arange(136)
POINTS = np.stack(np.meshgrid(X, Y), axis=-1)
DRIFT = -POINTS / 36.0


def dent(
    depth_mm: float, width_mm: float, led_height_mm: float
) -> tuple[ShadedField, FullModel, Array]:
    """Return a wide Gaussian dent as seen along the rays, its sensor, and its depth at each ray."""
    leds = np.array([[0.5, 11.8, 0.0], [-10.4, -5.6, 0.0], [10.1, -6.3, 0.0]])
    leds[:, 2] = -led_height_mm
    depth = np.zeros(POINTS.shape[:2])
    for _ in range(60):
        place = POINTS + depth[..., None] * DRIFT
        depth = depth_mm * np.exp(-(place**2).sum(-1) / (2.0 * width_mm**2))
    slopes = -place / width_mm**2 * depth[..., None]
    normals = np.concatenate([-slopes, -np.ones((*depth.shape, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    shown = []
    for at, facing in (
        (np.concatenate([place, -depth[..., None]], axis=-1), normals),
        (np.concatenate([POINTS, 0.0 * depth[..., None]], axis=-1), np.array([0.0, 0.0, -1.0])),
    ):
        away = leds - at[..., None, :]
        r = np.linalg.norm(away, axis=-1)
        lit = np.clip((away * np.expand_dims(facing, -2)).sum(-1) / r, 0.0, None)
        shown.append(lit * -away[..., 2] / r**3)
    ratio = np.asarray(shown[0] / shown[1], np.float32)
    return field_of(ratio, DRIFT, X, Y, sigma=0.002), full_model(MembraneBrdf(), leds), depth


def coarsen(field: ShadedField, factor: int) -> ShadedField:
    """Average the field, which is usable everywhere, over blocks of nodes."""
    rows, columns = (n // factor for n in field.usable.shape)

    def average(values: Array) -> Array:
        whole = np.ascontiguousarray(values[: rows * factor, : columns * factor])
        return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))

    x_mm = field.x_mm[: columns * factor].reshape(columns, factor).mean(axis=1)
    y_mm = field.y_mm[: rows * factor].reshape(rows, factor).mean(axis=1)
    return field_of(
        average(field.ratio), average(field.ray_slope), x_mm, y_mm, sigma=0.002 / factor
    )


def solved(field: ShadedField, full: FullModel) -> tuple[Array, tuple[float, ...], str]:
    """Run the rounds at quarter scale."""
    coarse = coarsen(field, 4)

    def one(depth: NDArray[np.float32]) -> NDArray[np.float32]:
        slopes = solve(coarse, depth, full.led_positions_mm, full.membrane)
        return integrate_weighted(
            slopes.slope_x,
            slopes.slope_y,
            slopes.weight,
            pitch_mm=4.0 * PITCH,
            start_mm=depth if depth.any() else None,
        ).depth_mm

    rounds = damped_rounds.DampedRounds(
        np.zeros(coarse.usable.shape, np.float32),
        damped_rounds.longest_step_mm(full),
        round_count=2,
    )
    while not rounds.stopped:
        rounds.add(one(rounds.depth_mm))
    rows, columns = field.usable.shape
    depth = cv2.resize(rounds.depth_mm, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return depth.astype(float), tuple(rounds.changes_mm), rounds.stopped


def rms(found: Array, expected: Array) -> float:
    return float(np.sqrt(np.mean((found - expected) ** 2)))


def test_an_ordinary_press_is_not_damped(monkeypatch):
    """Not a bit of its depth changes, nor the number of rounds."""
    field, full, depth = dent(1.5, 2.0, 13.7)
    found, changes, stopped = solved(field, full)
    assert (stopped, len(changes)) == ("done", 2)
    monkeypatch.setattr(damped_rounds, "LONGEST_STEP", np.inf)
    np.testing.assert_array_equal(found, solved(field, full)[0])
    # Quarter scale, brought back by straight lines: curvature 1.5 / 2^2 times 0.64^2 / 8.
    assert np.abs(found - depth).max() < 0.05


@pytest.mark.parametrize(
    ("depth_mm", "width_mm", "led_height_mm"), [(1.5, 3.5, 5.0), (2.5, 3.5, 7.0)]
)
def test_under_low_lights_damped_rounds_stay_near_where_others_leap_away(
    depth_mm, width_mm, led_height_mm, monkeypatch
):
    field, full, depth = dent(depth_mm, width_mm, led_height_mm)
    found, _, stopped = solved(field, full)
    assert stopped != "done"
    monkeypatch.setattr(damped_rounds, "LONGEST_STEP", np.inf)
    leapt, _, _ = solved(field, full)
    assert rms(found, depth) < 0.5 * rms(leapt, depth)
    assert found.max() < led_height_mm


def test_a_deep_press_that_was_damped_and_settled_is_right_and_says_so():
    field, full, depth = dent(3.0, 3.5, 13.7)
    found, changes, stopped = solved(field, full)
    assert stopped == "damped"
    assert changes[-1] < changes[0]
    assert np.abs(found - depth).max() < 0.15


def moved_by(sizes_um: list[float], most: int = 9) -> damped_rounds.LightRounds:
    rounds = damped_rounds.LightRounds()
    for size in sizes_um:
        assert not rounds.settled
        rounds.add(np.full((32, 48), 1e-3 * size, np.float32), 1, most)
    return rounds


def test_rounds_with_interreflection_end_where_no_area_moves_by_half_a_micrometre():
    assert not moved_by([8.0, 0.6]).settled
    assert moved_by([8.0, 0.4]).settled
    assert moved_by([8.0, 6.0, 5.0], most=3).settled
    # Single nodes may jump from one normal to the other, areas may not.
    rounds, jump = damped_rounds.LightRounds(), np.zeros((32, 48), np.float32)
    jump[3, 5] = 0.1
    rounds.add(jump, 1, 9)
    assert rounds.settled
    rounds = damped_rounds.LightRounds()
    jump[:16, 16:32] = 6e-4
    rounds.add(jump, 1, 9)
    assert not rounds.settled


def test_the_gain_is_that_of_a_geometric_series_and_says_what_it_still_adds():
    rounds = moved_by([32.0, 16.0, 8.0, 4.0])
    assert rounds.gain == pytest.approx(0.5)
    assert rounds.left_mm == pytest.approx(4e-3)  # 2 + 1 + 0.5 ...
    assert moved_by([0.2]).gain == moved_by([0.2]).left_mm == 0.0
    assert moved_by([5.0, 6.0]).gain == damped_rounds.MOST_GAIN
