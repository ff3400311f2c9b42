"""What each stage says about a frame: the right picture, the wrong picture, no picture."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, board_pose, render_board, true_corners

from app.calibrate.detect import (
    BallSetting,
    ball_setting,
    detect_ball,
    detect_board,
    detect_mirror,
    detect_top_pose,
)
from app.calibrate.detect_light import detect_background, detect_whiteboard
from app.calibrate.detection import Detection, with_note
from app.calibrate.marks import mirror_places
from gelpolight_core.calibration.calibration import sensor_stack
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.checkerboard import BoardSpec, BoardView
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.session.picture import Picture
from gelpolight_core.session.session import Session, read_picture, read_session


@dataclass(frozen=True)
class Known:
    """What earlier stages would have found."""

    camera: Camera
    plane: TopPlane
    table: ResamplingTable
    led_positions_mm: np.ndarray
    crosstalk: np.ndarray


def frame(picture: Picture) -> np.ndarray:
    """Return a picture as a camera gives it."""
    return np.round(np.clip(picture.rgb, 0.0, 1.0) * 255.0).astype(np.uint8)


def board_frame(**pose: float) -> np.ndarray:
    """Return a frame that shows the 9 x 6 board in a pose."""
    return frame(render_board(CAMERA, board_pose(**pose)))


def view_of(detection: Detection) -> BoardView:
    """Return the board that was found."""
    assert isinstance(detection.found, BoardView)
    return detection.found


@pytest.fixture(scope="module")
def tilted() -> np.ndarray:
    """Return a frame with the board tilted by 25 degrees."""
    return board_frame(tilt_deg=25.0, towards_deg=30.0)


@pytest.fixture(scope="module")
def session(virtual_session: Path) -> Session:
    """Return the session of the virtual sensor."""
    return read_session(virtual_session)


@pytest.fixture(scope="module")
def pictures(session: Session) -> dict[str, np.ndarray]:
    """Return one frame of every stage."""
    stages = ("checkerboard", "top_pose", "mirror", "whiteboard", "background", "balls")
    frames = {stage: frame(read_picture(session.files(stage)[0])) for stage in stages}
    frames["press"] = frame(read_picture(session.folder / "presses" / "cylinder_s5_d100.png"))
    return frames


@pytest.fixture(scope="module")
def known(session: Session, pictures: dict[str, np.ndarray]) -> Known:
    """Return what a perfect calibration would know of the virtual sensor."""
    truth = json.loads((session.folder / "truth.json").read_text("utf-8"))
    optics, top = truth["camera"], truth["top_plane"]
    height, width = pictures["mirror"].shape[:2]
    camera = Camera(
        width,
        height,
        *(optics[key] for key in ("fx", "fy", "cx", "cy")),
        (*optics["k1_k2_p1_p2"], 0.0),
    )
    plane = TopPlane(tuple(top["normal_camera"]), top["offset_mm"])
    table = build_resampling_table(
        camera,
        plane,
        sensor_stack(session.sensor, plane),
        working_diameter_mm=session.sensor.working_diameter_mm,
    )
    leds = plane.to_sensor(np.array([truth["leds"][name]["camera_mm"] for name in "RGB"]))
    return Known(camera, plane, table, leds, np.array(truth["crosstalk_camera_from_led"]))


@pytest.fixture(scope="module")
def setting(session: Session, known: Known) -> BallSetting:
    """Return what the ball stage knows of the earlier ones."""
    return ball_setting(
        session.averaged("background"), known.table, known.led_positions_mm, known.crosstalk
    )


def test_a_board_is_marked_on_its_true_corners(tilted: np.ndarray) -> None:
    seen = detect_board(tilted, BOARD)
    assert seen.ready
    crosses = [(m.u, m.v) for m in seen.overlay.markers if m.kind == "plus"]
    truth = true_corners(CAMERA, board_pose(tilt_deg=25.0, towards_deg=30.0))
    away = np.linalg.norm(np.array(crosses)[:, None] - truth[None], axis=2).min(axis=1)
    assert len(crosses) == 54
    assert away.max() < 0.2


def test_sixteen_bit_frames_are_seen_as_well(tilted: np.ndarray) -> None:
    seen = detect_board(tilted.astype(np.uint16) * 257, BOARD)
    assert view_of(seen).corners_px == pytest.approx(
        view_of(detect_board(tilted, BOARD)).corners_px, abs=0.01
    )


def test_the_next_view_is_asked_for_where_nothing_was_seen() -> None:
    seen = detect_board(board_frame(tilt_deg=20.0, centre_mm=(-6.0, -4.0), distance_mm=60.0), BOARD)
    assert seen.ready
    assert "at the bottom right" in seen.sentence or "at the top right" in seen.sentence


def test_a_view_like_an_earlier_one_is_not_taken_again(tilted: np.ndarray) -> None:
    first = view_of(detect_board(tilted, BOARD))
    again = detect_board(tilted, BOARD, earlier=[first])
    assert not again.ready
    assert "as in an earlier view" in again.sentence
    turned = replace(first, corners_px=first.corners_px[::-1])
    assert not detect_board(tilted, BOARD, earlier=[turned]).ready
    other = board_frame(tilt_deg=25.0, towards_deg=210.0)
    assert detect_board(other, BOARD, earlier=[first]).ready


def test_after_two_flat_views_a_tilted_one_is_asked_for() -> None:
    flat = [
        view_of(detect_board(board_frame(tilt_deg=2.0, roll_deg=roll), BOARD))
        for roll in (5.0, 40.0)
    ]
    third = board_frame(tilt_deg=2.0, roll_deg=-30.0)
    assert "tilt it more" in detect_board(third, BOARD, earlier=flat).sentence
    assert not detect_board(third, BOARD, earlier=flat).ready
    assert detect_board(third, BOARD, earlier=flat[:1]).ready


def test_earlier_views_stay_drawn_faintly_also_without_a_board(tilted: np.ndarray) -> None:
    first = view_of(detect_board(tilted, BOARD))
    black = np.zeros_like(tilted)
    nothing = detect_board(black, BOARD, earlier=[first])
    assert [line.role for line in nothing.overlay.lines] == ["info"]
    assert nothing.sentence.startswith("The picture is black.")


def test_a_blurred_board_is_told_to_be_blurred(tilted: np.ndarray) -> None:
    seen = detect_board(cv2.GaussianBlur(tilted, (0, 0), 4.0), BOARD)
    assert not seen.ready
    assert "blurred" in seen.sentence


def test_patience_names_the_size_of_another_board(tilted: np.ndarray) -> None:
    wanted = BoardSpec((7, 5), 3.0)
    assert not detect_board(tilted, wanted).ready
    assert "9 x 6 inner corners, not 7 x 5" in detect_board(tilted, wanted, patient=True).sentence


def test_the_board_on_top_says_how_the_surface_lies(
    pictures: dict[str, np.ndarray], session: Session, known: Known
) -> None:
    seen = detect_top_pose(pictures["top_pose"], session.top_pose, known.camera)
    assert seen.ready
    assert f"{known.plane.distance_mm:.1f}" in seen.sentence
    origin = next(m for m in seen.overlay.markers if m.text == "origin")
    expected = known.camera.project(known.plane.origin_camera_mm)
    assert (origin.u, origin.v) == pytest.approx(tuple(expected), abs=1.0)


def test_mirror_spots_are_found_where_the_leds_are_mirrored(
    pictures: dict[str, np.ndarray], known: Known
) -> None:
    expected = mirror_places(known.camera, known.plane, known.led_positions_mm)
    seen = detect_mirror(pictures["mirror"], expected_px=expected, editable=True)
    assert seen.ready
    handles = {m.handle: (m.u, m.v) for m in seen.overlay.markers if m.handle}
    assert sorted(handles) == ["mirror.0", "mirror.1", "mirror.2"]
    for k in range(3):
        assert handles[f"mirror.{k}"] == pytest.approx(tuple(expected[k]), abs=0.3)
        row, column = round(handles[f"mirror.{k}"][1]), round(handles[f"mirror.{k}"][0])
        assert seen.overlay.masks[k].area[row, column]


def test_a_spot_in_the_wrong_place_is_told(pictures: dict[str, np.ndarray], known: Known) -> None:
    swapped = known.led_positions_mm[[1, 0, 2]]
    expected = mirror_places(known.camera, known.plane, swapped)
    seen = detect_mirror(pictures["mirror"], expected_px=expected)
    assert "expected place" in seen.sentence


def test_a_saturated_whiteboard_is_refused_and_shown_where(
    pictures: dict[str, np.ndarray], known: Known
) -> None:
    good = detect_whiteboard(pictures["whiteboard"], table=known.table)
    assert good.ready, good.sentence
    assert all(mask.role != "bad" for mask in good.overlay.masks)
    hot = np.clip(pictures["whiteboard"].astype(int) * 2, 0, 255).astype(np.uint8)
    bad = detect_whiteboard(hot, table=known.table)
    assert not bad.ready
    assert "Shorten the exposure" in bad.sentence
    np.testing.assert_array_equal(bad.overlay.masks[0].area, (hot == 255).any(axis=2))


def test_a_missing_led_is_named(pictures: dict[str, np.ndarray], known: Known) -> None:
    dark = pictures["whiteboard"].copy()
    dark[..., 1] = 0
    for seen in (
        detect_whiteboard(dark, table=known.table),
        detect_background(dark, table=known.table),
    ):
        assert not seen.ready
        assert "Switch the green LED on" in seen.sentence


def test_a_bare_membrane_is_ready_and_a_pressed_one_is_not(
    pictures: dict[str, np.ndarray], known: Known
) -> None:
    table, white = known.table, pictures["whiteboard"]
    bare = detect_background(pictures["background"], table=table, whiteboard=white)
    assert bare.ready, bare.sentence
    for pressed in ("balls", "press"):
        seen = detect_background(pictures[pressed], table=table, whiteboard=white)
        assert not seen.ready
        assert "Lift off whatever touches" in seen.sentence


def test_the_press_is_shown_where_it_is(
    pictures: dict[str, np.ndarray], setting: BallSetting, known: Known
) -> None:
    """By the detection of the background stage, against the ball stage's own circle."""
    ball = detect_ball(pictures["balls"], setting, radius_mm=3.0, editable=True)
    circle = ball.overlay.circles[0]
    seen = detect_background(
        pictures["balls"], table=known.table, whiteboard=pictures["whiteboard"]
    )
    rows, columns = np.nonzero(seen.overlay.masks[0].area)
    assert np.hypot(columns.mean() - circle.u, rows.mean() - circle.v) < 0.5 * circle.radius_px


def test_the_whiteboard_left_on_is_not_taken_for_the_membrane(
    pictures: dict[str, np.ndarray],
) -> None:
    seen = detect_background(pictures["whiteboard"], whiteboard=pictures["whiteboard"])
    assert "just like the whiteboard's" in seen.sentence
    assert "capture that again" in seen.sentence


def test_the_membrane_left_on_is_not_taken_for_the_whiteboard(
    pictures: dict[str, np.ndarray], known: Known
) -> None:
    bare = pictures["background"]
    seen = detect_whiteboard(bare, table=known.table, background=bare)
    assert not seen.ready
    assert "just like the background's" in seen.sentence
    assert detect_whiteboard(pictures["whiteboard"], table=known.table, background=bare).ready


def test_without_a_whiteboard_nothing_is_said_about_presses_but_that(
    pictures: dict[str, np.ndarray], known: Known
) -> None:
    seen = detect_background(pictures["background"], table=known.table)
    assert "once the whiteboard is captured" in seen.sentence


def test_a_ball_is_circled_where_it_is_seen(
    pictures: dict[str, np.ndarray], setting: BallSetting, session: Session
) -> None:
    radius_mm = session.ball_radius_mm(session.files("balls")[0].name)
    seen = detect_ball(
        pictures["balls"], setting, radius_mm=radius_mm, earlier_mm=[(0.0, 0.0)], editable=True
    )
    assert seen.ready, seen.sentence
    (circle,) = seen.overlay.circles
    assert circle.handle == "ball"
    # The raw picture is changed within the contact and hardly outside of the drape.
    change = np.abs(pictures["balls"].astype(int) - pictures["background"]).sum(axis=2)
    v, u = np.mgrid[: change.shape[0], : change.shape[1]]
    away = np.hypot(u - circle.u, v - circle.v) / circle.radius_px
    assert change[away < 1.0].mean() > 10.0 * change[(away > 2.5) & (away < 4.0)].mean()
    rim, contour, fitted = seen.overlay.lines
    assert rim.role == "info"
    for line in (contour, fitted):
        radius = np.hypot(*(line.points - (circle.u, circle.v)).T)
        assert radius == pytest.approx(circle.radius_px, rel=0.1)
    assert [m.kind for m in seen.overlay.markers] == ["dot"]


WRONG = [
    ("checkerboard", "mirror"),
    ("checkerboard", "whiteboard"),
    ("checkerboard", "balls"),
    ("top_pose", "background"),
    ("mirror", "checkerboard"),
    ("mirror", "whiteboard"),
    ("mirror", "balls"),
    ("whiteboard", "checkerboard"),
    ("whiteboard", "mirror"),
    ("background", "mirror"),
    ("background", "top_pose"),
    ("balls", "background"),
    ("balls", "mirror"),
    ("balls", "checkerboard"),
    ("balls", "press"),
]


def look(
    stage: str, rgb: np.ndarray, session: Session, known: Known, setting: BallSetting
) -> Detection:
    """Return what a stage says about a frame."""
    match stage:
        case "checkerboard":
            return detect_board(rgb, session.checkerboard)
        case "top_pose":
            return detect_top_pose(rgb, session.top_pose, known.camera)
        case "mirror":
            return detect_mirror(rgb)
        case "whiteboard":
            return detect_whiteboard(rgb, table=known.table)
        case "background":
            return detect_background(rgb, table=known.table)
        case _:
            return detect_ball(rgb, setting, radius_mm=3.0)


@pytest.mark.parametrize(("stage", "shown"), WRONG)
def test_the_picture_of_another_stage_is_refused_in_a_sentence(
    stage: str,
    shown: str,
    pictures: dict[str, np.ndarray],
    session: Session,
    known: Known,
    setting: BallSetting,
) -> None:
    seen = look(stage, pictures[shown], session, known, setting)
    assert not seen.ready
    assert not seen.sentence[0].islower()
    assert seen.sentence.endswith(".")
    assert with_note(seen).notes[0].role == "bad"


@pytest.mark.parametrize("stage", ["checkerboard", "top_pose", "mirror", "whiteboard", "balls"])
@pytest.mark.parametrize("level", [0, 128, 255])
def test_empty_pictures_are_refused_by_every_stage(
    stage: str,
    level: int,
    pictures: dict[str, np.ndarray],
    session: Session,
    known: Known,
    setting: BallSetting,
) -> None:
    empty = np.full_like(pictures["mirror"], level)
    assert not look(stage, empty, session, known, setting).ready


def test_a_frame_of_another_size_is_refused(
    pictures: dict[str, np.ndarray],
    session: Session,
    known: Known,
    setting: BallSetting,
) -> None:
    small = cv2.resize(pictures["balls"], (320, 240))
    for stage in ("top_pose", "balls"):
        assert not look(stage, small, session, known, setting).ready
