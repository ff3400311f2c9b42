"""A user presses an object and reads its size, height, place, uncertainty and verdict."""

import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.measurement import indenter_fit
from gelpolight_core.measurement.drape import ball_depth, cuboid_depth, cylinder_depth
from gelpolight_core.measurement.object_measurement import measure_object
from gelpolight_core.session.reference_object import ReferenceObject
from tests.measurement.maps import on_grid

Array = NDArray[np.float64]

PITCH = 0.05
X = np.arange(-10.0, 10.0, PITCH)
Y = np.arange(-8.0, 8.0, PITCH)


def pressed(
    shape: str,
    *,
    centre: tuple[float, float] = (1.3, -0.7),
    size: tuple[float, float] = (5.0, 5.0),
    height: float = 1.0,
    yaw_deg: float = 20.0,
    decay: float = 0.7,
    edge: float = 0.08,
) -> Array:
    x, y = np.meshgrid(X - centre[0], Y - centre[1])
    if shape == "ball":
        return ball_depth(
            np.hypot(x, y), ball_radius_mm=size[0] / 2, height_mm=height, decay_mm=decay
        )
    options = {"height_mm": height, "decay_mm": decay, "edge_radius_mm": edge}
    if shape == "cylinder":
        return cylinder_depth(np.hypot(x, y), cylinder_radius_mm=size[0] / 2, **options)
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return cuboid_depth(cos * x + sin * y, cos * y - sin * x, side_mm=size, **options)


def noisy(depth: Array, seed: int, sigma: float = 0.001) -> NDArray[np.float32]:
    noise = np.random.default_rng(seed).standard_normal(depth.shape)
    return (depth + sigma * noise).astype(np.float32)


@pytest.mark.function("Fit a cylinder without its drape")
@given(
    diameter=st.floats(2.0, 7.0),
    height=st.floats(0.3, 1.5),
    decay=st.floats(0.5, 1.0),
    x=st.floats(-3.0, 3.0),
    y=st.floats(-2.0, 2.0),
)
@settings(max_examples=8, deadline=None)
def test_a_cylinder_anywhere_is_measured_without_its_drape(diameter, height, decay, x, y):
    depth = pressed("cylinder", size=(diameter, 0.0), height=height, decay=decay, centre=(x, y))
    measured = measure_object(on_grid(noisy(depth, 1), X, Y), shape="cylinder")
    assert measured.diameter_mm == pytest.approx(diameter, abs=max(5 * measured.size_sd_mm, 0.01))
    assert measured.height_mm == pytest.approx(height, abs=0.003)
    assert measured.centre_mm == pytest.approx((x, y), abs=0.005)
    assert measured.drape_decay_mm == pytest.approx(decay, abs=0.02)
    assert measured.verdict == "ok"


@pytest.mark.function("Fit a cuboid with both sides and rotation")
@pytest.mark.parametrize("yaw", [-44.0, 30.0])
def test_a_cuboid_is_measured_with_both_sides_and_its_yaw(yaw):
    depth = pressed("cuboid", size=(4.0, 6.0), yaw_deg=yaw)
    measured = measure_object(on_grid(noisy(depth, 2), X, Y), shape="cuboid")
    # How far the edge is rounded moves both sides.
    assert measured.side_mm == pytest.approx((4.0, 6.0), abs=max(3 * measured.size_sd_mm, 0.01))
    assert measured.size_sd_mm < 0.12
    assert measured.yaw_deg == pytest.approx(yaw, abs=0.1)
    assert measured.verdict == "ok"


@pytest.mark.function("Fit a ball")
@pytest.mark.parametrize(("diameter", "height"), [(6.0, 0.9), (8.0, 0.6), (4.0, 1.2)])
def test_of_a_ball_the_diameter_is_the_balls_not_the_contacts(diameter, height):
    depth = pressed("ball", size=(diameter, 0.0), height=height)
    measured = measure_object(on_grid(noisy(depth, 3), X, Y), shape="ball")
    assert measured.diameter_mm == pytest.approx(diameter, abs=5 * measured.size_sd_mm)
    assert measured.size_sd_mm < 0.01 * diameter
    assert measured.height_mm == pytest.approx(height, abs=0.005)


@pytest.mark.function("Know the standard deviation of each figure")
@pytest.mark.parametrize("shape", ["cylinder", "ball"])
def test_the_stated_sd_is_the_scatter_of_repeats(shape):
    scatter_is_stated(shape)


def scatter_is_stated(shape: str) -> None:
    """Measure 12 repeats."""
    depth = pressed(shape)
    repeats = [measure_object(on_grid(noisy(depth, seed), X, Y), shape=shape) for seed in range(12)]
    size = "side_mm" if shape == "cuboid" else "diameter_mm"
    for name in (size, "height_mm", "centre_mm"):
        values = np.array([getattr(m, name) for m in repeats]).reshape(12, -1)[:, 0]
        stated = np.array([m.sd[name] for m in repeats]).reshape(12, -1)[:, 0]
        # A factor 1.5, and 12 repeats know their own scatter to 21 %, doubled for 95 %. Size and
        # height also follow from the object's edge, the same in all repeats and not known.
        most = np.inf if name != "centre_mm" and shape != "ball" else 1.85
        assert 0.5 < stated.mean() / values.std(ddof=1) < most, name


@pytest.mark.parametrize("shape", ["cylinder", "cuboid"])
def test_a_real_reconstructions_errors_leave_the_sizes_usable(shape):
    depth = pressed(shape)
    rng = np.random.default_rng(0)
    ground = gaussian_filter(rng.standard_normal(depth.shape), 2.5 / PITCH)
    x, y = np.meshgrid(X - 1.3, Y + 0.7)
    dome = 0.03 * np.clip(1.0 - (x**2 + y**2) / 2.5**2, 0.0, None)
    worse = gaussian_filter(depth + dome, 1.0) + 0.02 * ground / ground.std()
    measured = measure_object(on_grid(noisy(worse, 0), X, Y), shape=shape)
    assert measured.size_mm == pytest.approx(5.0, rel=0.015)
    # The dome itself lifts the face by 1.5 % on average, the ground is off by 2 % of the height.
    assert measured.height_mm == pytest.approx(1.0, rel=0.05)
    assert abs(measured.size_mm - 5.0) < 3.0 * measured.size_sd_mm


def test_flagged_and_missing_pixels_do_not_move_the_result():
    depth = noisy(pressed("cylinder"), 4)
    flags = np.zeros(depth.shape, dtype=np.uint8)
    x, y = np.meshgrid(X - 1.3, Y + 0.7)
    flags[(np.arctan2(y, x) > 0.2) & (np.arctan2(y, x) < 0.7)] = 4
    depth[flags == 4] -= np.float32(0.05)
    flags[np.hypot(x, y) > 7.0] = 1
    depth[flags == 1] = 9.0
    depth[::7, ::5] = np.nan
    measured = measure_object(on_grid(depth, X, Y, flags), shape="cylinder")
    assert measured.diameter_mm == pytest.approx(5.0, rel=0.01)
    assert measured.height_mm == pytest.approx(1.0, rel=0.01)


def test_the_object_under_the_seed_is_measured():
    both = pressed("cylinder", centre=(-4.5, 0.0), size=(3.0, 0.0)) + pressed(
        "cylinder", centre=(4.5, 1.0), size=(4.0, 0.0)
    )
    depth = noisy(both, 6)
    with pytest.raises(InputError, match=r"2 objects.*--seed"):
        measure_object(on_grid(depth, X, Y), shape="cylinder")
    left = measure_object(on_grid(depth, X, Y), shape="cylinder", seed_mm=(-4.0, 0.5))
    right = measure_object(on_grid(depth, X, Y), shape="cylinder", seed_mm=(4.5, 1.0))
    assert left.diameter_mm == pytest.approx(3.0, rel=0.01)
    assert right.diameter_mm == pytest.approx(4.0, rel=0.01)
    with pytest.raises(InputError, match="no object lies at"):
        measure_object(on_grid(depth, X, Y), shape="cylinder", seed_mm=(0.0, -6.0))


@pytest.mark.function("Be told that a result is doubtful, and why")
@pytest.mark.parametrize(
    ("pressed_shape", "measured_shape"), list(permutations(("cylinder", "cuboid", "ball"), 2))
)
def test_the_wrong_shape_is_doubtful_and_the_right_one_named(pressed_shape, measured_shape):
    measured = measure_object(on_grid(noisy(pressed(pressed_shape), 7), X, Y), shape=measured_shape)
    assert measured.verdict == "doubtful"
    assert f"a {pressed_shape} fits better" in measured.reason


def test_a_membrane_without_an_object_is_refused():
    for depth in (np.zeros((Y.size, X.size)), noisy(np.zeros((Y.size, X.size)), 8)):
        with pytest.raises(InputError, match="no object is pressed"):
            measure_object(on_grid(depth, X, Y), shape="ball")
    wavy = gaussian_filter(np.random.default_rng(1).standard_normal((Y.size, X.size)), 30.0)
    with pytest.raises(InputError, match="no object is pressed"):
        measure_object(on_grid(0.02 * wavy / wavy.std(), X, Y), shape="ball")


def test_an_object_at_the_border_is_refused_and_a_cut_drape_doubtful():
    cut = noisy(pressed("cylinder", centre=(9.0, 0.0)), 9)
    with pytest.raises(InputError, match="cut by the border"):
        measure_object(on_grid(cut, X, Y), shape="cylinder")
    close = noisy(pressed("cylinder", centre=(6.6, 4.8)), 9)
    measured = measure_object(on_grid(close, X, Y), shape="cylinder")
    assert measured.verdict == "doubtful"
    assert "of the slope around" in measured.reason


@pytest.mark.function("`gelpolight measure --json`: what scripts rely on")
def test_json_holds_what_scripts_rely_on():
    measured = measure_object(on_grid(noisy(pressed("cuboid"), 10), X, Y), shape="cuboid")
    plain = json.loads(json.dumps(measured.as_json(ReferenceObject("cuboid", 5.0, height_mm=1.0))))
    assert set(plain["sd"]) == {"side_mm", "height_mm", "centre_mm", "yaw_deg", "drape_decay_mm"}
    assert len(plain["side_mm"]) == len(plain["sd"]["side_mm"]) == 2
    assert plain["truth"] == {"shape": "cuboid", "side_mm": 5.0, "height_mm": 1.0}
    assert plain["error_percent"]["side_mm"] == pytest.approx(
        100 * (np.mean(plain["side_mm"]) / 5.0 - 1)
    )
    assert plain["verdict"] == "ok"
    round_one = measure_object(
        on_grid(noisy(pressed("cylinder"), 10), X, Y), shape="cylinder"
    ).as_json()
    assert "side_mm" not in round_one
    assert round_one["diameter_mm"] == pytest.approx(5.0, rel=0.01)
    assert round_one["truth"] is None


def test_true_depth_maps_give_the_true_sizes(shared_data):
    folder = shared_data / "sensor-A"
    for row in read_truth(folder / "presses").rows[::4]:
        with np.load(folder / "truth" / f"{Path(row.file).stem}.npz") as file:
            depth, pitch = file["depth_mm"], float(file["pitch_mm"])
            x = float(file["x0_mm"]) + pitch * np.arange(depth.shape[1])
            y = float(file["y0_mm"]) + pitch * np.arange(depth.shape[0])
        measured = measure_object(on_grid(depth, x, y), shape=row.truth.shape)
        assert measured.size_mm == pytest.approx(row.truth.size_mm, rel=0.003), row.file
        assert measured.height_mm == pytest.approx(row.truth.height_mm, rel=0.002), row.file


@pytest.mark.parametrize(("shape", "radius_mm"), [("ball", 0.1), ("cylinder", -0.1)])
def test_an_edge_radius_that_cannot_be_is_refused(shape, radius_mm):
    with pytest.raises(InputError, match="edge radius"):
        measure_object(on_grid(pressed(shape), X, Y), shape=shape, edge_radius_mm=radius_mm)


@pytest.mark.parametrize("shape", ["ball", "cylinder", "cuboid"])
def test_a_step_far_beyond_the_map_is_tried_and_rejected(shape, monkeypatch):
    """On a torn gel, a fit tried walls kilometres away: their profile was larger than memory."""
    surface = on_grid(pressed(shape), X, Y)
    usual = measure_object(surface, shape=shape)
    fit, tried = indenter_fit.fit_least_squares, []

    def with_far_step(residuals, slopes, start, bounds, **options):
        far = np.asarray(start).copy()
        far[0] += 1e7
        tried.append(np.isfinite(residuals(far)).all())
        return fit(residuals, slopes, start, bounds, **options)

    monkeypatch.setattr(indenter_fit, "fit_least_squares", with_far_step)
    assert measure_object(surface, shape=shape).size_mm == usual.size_mm
    assert tried and all(tried)


def test_a_part_at_the_border_that_looks_pressed_is_said_beside_the_whole_object():
    """Light that changes looks like a contact in the corners of some sensors."""
    alone = pressed("ball", centre=(1.0, 0.0), height=1.0)
    corner = pressed("ball", centre=(-9.5, -7.5), height=0.6)
    found = measure_object(on_grid(np.maximum(alone, corner), X, Y), shape="ball")
    assert next(f.key for f in found.findings) == "other_part"
    assert found.verdict == "doubtful"
    usual = measure_object(on_grid(alone, X, Y), shape="ball")
    assert found.diameter_mm == pytest.approx(usual.diameter_mm, rel=0.01)
    pointed = measure_object(
        on_grid(np.maximum(alone, corner), X, Y), shape="ball", seed_mm=(1.0, 0.0)
    )
    assert "other_part" not in [f.key for f in pointed.findings]
    deeper = pressed("ball", centre=(-9.5, -7.5), height=1.4)
    with pytest.raises(InputError, match="2 objects"):
        measure_object(on_grid(np.maximum(alone, deeper), X, Y), shape="ball")
