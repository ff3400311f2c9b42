"""A simulated session is a complete session folder, identical for the same seed."""

import csv
import hashlib
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.board_scene import board_views
from gelpolight_core.simulation.design_parts import BallPressDesign, PressDesign, SessionDesign
from gelpolight_core.simulation.indenters import CuboidIndenter, press_surface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session
from gelpolight_core.simulation.virtual_sensor import VirtualSensor

SCALE = 0.25
USUAL = SensorDesign()
DESIGN = replace(
    USUAL,
    layers=replace(USUAL.layers, elastomer_absorption_per_mm=(0.004, 0.005, 0.009)),
    leds=tuple(replace(led, axis_tilt=(0.05, -0.04)) for led in USUAL.leds),
    ring=replace(USUAL.ring, lobe_exponent=1.6, nominal_half_angle_deg=50.0),
    membrane=replace(USUAL.membrane, stretch_loss=0.12),
    balls=(BallPressDesign(3.0, 1.0, -2.0, 1.0), BallPressDesign(4.0, 0.8, 3.0, -2.0)),
    presses=(
        PressDesign("cylinder", 5.0, 1.0, 2.0, 1.0),
        PressDesign("nut", 5.5, 0.8, -2.0, -1.0, 10.0),
    ),
)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Return a small simulated session."""
    out = tmp_path_factory.mktemp("virtual") / "session"
    simulate_session(DESIGN, out, seed=3, scale=SCALE)
    return out


def digests(folder: Path) -> dict[str, str]:
    """Return the hash of every image."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*.png"))
    }


@pytest.mark.function("`gelpolight simulate`: a session of the virtual sensor with its truth")
def test_every_stage_has_its_images(session):
    counts = {p.name: len(list(p.glob("*.png"))) for p in session.iterdir() if p.is_dir()}
    assert counts == {
        "checkerboard": 16,
        "top_pose": 1,
        "mirror": 1,
        "whiteboard": 1,
        "background": 1,
        "balls": 2,
        "presses": 2,
        "truth": 0,
    }


@pytest.mark.function("`gelpolight simulate --closed`: of a closed sensor")
def test_a_closed_sensor_shows_background_balls_and_scale_only(session, tmp_path):
    closed = tmp_path / "closed"
    simulate_session(replace(DESIGN, presses=()), closed, seed=3, scale=SCALE, closed=True)
    assert {p.name for p in closed.iterdir() if p.is_dir()} == {
        "background", "balls", "presses", "truth"
    }  # fmt: skip
    same = digests(session)
    assert all(same[name] == digest for name, digest in digests(closed).items())
    read = read_session(closed)
    # The membrane is 34.26 mm behind the lens as refraction shows it, the focal length 346.4 px.
    assert read.in_place is not None
    assert read.in_place.stated_scale == pytest.approx(34.26 / 346.4, rel=0.02)
    assert read.ball_radius_mm("ball_01.png") == 4.0


def test_description_and_truth_say_what_was_simulated(session):
    text = tomllib.loads((session / "session.toml").read_text())
    assert text["sensor"]["elastomer_refractive_index"] == 1.41
    assert text["balls"]["radius_mm"] == {"ball_00.png": 3.0, "ball_01.png": 4.0}
    truth = json.loads((session / "truth.json").read_text())
    assert truth["camera"]["fx"] == pytest.approx(1385.6 * SCALE)
    # The position of an LED in the camera frame keeps its height below the plane.
    normal, offset = np.array(truth["top_plane"]["normal_camera"]), truth["top_plane"]["offset_mm"]
    for led, design in zip(truth["leds"].values(), DESIGN.leds, strict=True):
        assert offset - normal @ led["camera_mm"] == pytest.approx(design.height_mm)
        assert (led["lobe_exponent"], led["axis_tilt"]) == (1.6, [0.05, -0.04])
    assert truth["elastomer_absorption_per_mm"] == [0.004, 0.005, 0.009]
    assert truth["membrane"]["stretch_loss"] == 0.12
    assert read_session(session).sensor.led_half_angle_deg == 50.0
    assert truth["balls"][0]["contact_radius_mm"] == pytest.approx(1.7611, abs=1e-3)


def test_truth_of_a_press_is_its_depth_on_a_metric_grid(session):
    with (session / "presses" / "truth.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["file"] for row in rows] == ["cylinder_s5_d100.png"]
    with np.load(session / "truth" / "cylinder_s5_d100.npz") as truth:
        depth, pitch = truth["depth_mm"], float(truth["pitch_mm"])
        x = float(truth["x0_mm"]) + pitch * np.arange(depth.shape[1])
        y = float(truth["y0_mm"]) + pitch * np.arange(depth.shape[0])
        assert truth["contact"].shape == depth.shape
    # Two cells of the quarter-size session inside the rounded edge.
    face = np.hypot(*np.meshgrid(x - 2.0, y - 1.0)) < 2.45 - 0.2
    assert depth.dtype == np.float32
    assert np.allclose(depth[face], 1.0, atol=1e-6)
    assert (session / "truth" / "object_nut.npz").exists()


def test_boards_are_found_where_they_were_put(session):
    poses = board_views(DESIGN.scaled(SCALE).camera, np.random.default_rng([3, 2]))
    camera = DESIGN.scaled(SCALE).camera
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    for number in (0, 5, 10, 15):
        image = cv2.imread(str(session / f"checkerboard/view_{number:02d}.png"), 0)
        found, corners = cv2.findChessboardCornersSB(image, (9, 6), None, cv2.CALIB_CB_ACCURACY)
        assert found
        expected, _ = cv2.projectPoints(
            poses[number].corners_mm(),
            np.zeros(3),
            np.zeros(3),
            matrix,
            np.array(camera.distortion),
        )
        gaps = np.linalg.norm(corners.reshape(-1, 1, 2) - expected.reshape(1, -1, 2), axis=2)
        # A square is about ten pixels wide here: the detector is accurate to a tenth of a pixel.
        assert gaps.min(axis=1).mean() < 0.15


def test_the_same_seed_gives_the_same_images(session, tmp_path):
    bare = replace(DESIGN, balls=(), presses=())
    simulate_session(bare, tmp_path / "again", seed=3, scale=SCALE)
    simulate_session(bare, tmp_path / "other", seed=4, scale=SCALE, closed=True)
    first, again, other = (digests(tmp_path / name) for name in (session, "again", "other"))
    assert len(again) > 16 and again.items() <= first.items()
    assert other and all(digest != first[name] for name, digest in other.items())


def test_a_folder_with_files_is_not_changed(tmp_path):
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(InputError, match="already contains files"):
        simulate_session(DESIGN, tmp_path, scale=SCALE)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_progress_can_stop_the_work(tmp_path):
    def stop(name: str, share: float) -> None:
        assert 0.0 < share <= 1.0 and name
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_session(DESIGN, tmp_path / "out", scale=SCALE, progress=stop)
    assert not (tmp_path / "out").exists()


def test_a_press_and_a_sensor_that_are_being_made_can_be_stopped():
    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        press_surface(CuboidIndenter(5.0, 1.0), interrupt=stop)
    with pytest.raises(KeyboardInterrupt):
        VirtualSensor(DESIGN.scaled(SCALE), interrupt=stop)


def test_a_session_that_cannot_be_finished_leaves_the_folder_as_it_was(tmp_path, monkeypatch):
    """Half a session would be mistaken for a complete one, or block the next attempt."""

    def full(path: Path, _writer: object) -> None:
        if path.suffix == ".png":
            raise InputError("the disk is full", where=str(path), advice="Free some space")
        path.touch()

    monkeypatch.setattr("gelpolight_core.simulation.simulated_session.write_atomically", full)
    with pytest.raises(InputError, match="full"):
        simulate_session(DESIGN, tmp_path, scale=SCALE)
    assert not list(tmp_path.iterdir())


@pytest.mark.function("`gelpolight simulate --design`: of a sensor of one's own")
def test_what_a_design_asks_for_besides_is_there(tmp_path):
    """A camera of gamma 2.2 that declares nothing, with a series and single-LED images."""
    design = replace(
        DESIGN,
        balls=(),
        presses=(),
        camera=replace(DESIGN.camera, response="gamma", shot_variance=0.0, read_sd=0.0),
        session=SessionDesign(declares_response=False, response_pictures=4, single_led=True),
    )
    simulate_session(design, tmp_path / "bent", scale=SCALE)
    text = tomllib.loads((tmp_path / "bent" / "session.toml").read_text())
    assert "camera" not in text
    times = text["response"]
    assert list(times) == [f"exp_{k:02d}.png" for k in range(4)]
    place = (120, 160)
    light = [
        (cv2.imread(str(tmp_path / "bent/response" / name))[place] / 255.0) ** 2.2 for name in times
    ]
    # Half a step of the brighter value: 2.2 / 2 / 255 of its light over its value.
    ratio = times["exp_02.png"] / times["exp_01.png"]
    assert light[2] / light[1] == pytest.approx(ratio, rel=0.05)
    for channel, name in zip((2, 1, 0), ("red", "green", "blue"), strict=True):
        lit = cv2.imread(str(tmp_path / "bent/single_led" / f"{name}.png"))[place]
        assert int(np.argmax(lit)) == channel
