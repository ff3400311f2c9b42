"""The detection of each stage: the right image, the wrong image, no image."""

import json
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, board_pose, render_board, true_corners

from app.calibrate.ball_steps import BallDetectionInputs, detect_open_ball, press_marks
from app.calibrate.board_steps import detect_board, detect_top_pose
from app.calibrate.detection_marks import as_image, mirror_positions_px
from app.calibrate.light_steps import detect_background, detect_mirror, detect_whiteboard
from app.live.live_detection import Detection
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.image_checks import require_lit_colours
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.sensor.sensor_calibration import sensor_stack
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.stages.checkerboards.checkerboard import find_board
from gelpolight_core.stages.leds.crosstalk import unmix


@dataclass(frozen=True)
class Known:
    """Results of the earlier stages."""

    camera: CameraModel
    plane: TopPlane
    table: ResamplingTable
    led_positions_mm: np.ndarray
    crosstalk: np.ndarray


def frame(image: LinearImage) -> np.ndarray:
    """Return an image as a camera delivers it."""
    return np.round(np.clip(image.rgb, 0.0, 1.0) * 255.0).astype(np.uint8)


def board_frame(**pose: float) -> np.ndarray:
    """Return a frame of the 9 x 6 board in a pose."""
    return frame(render_board(CAMERA, board_pose(**pose)))


@pytest.fixture(scope="module")
def tilted():
    """Return a frame with the board tilted by 25 degrees."""
    return board_frame(tilt_deg=25.0, towards_deg=30.0)


@pytest.fixture(scope="module")
def session(small_session):
    """Return the session of the virtual sensor."""
    return read_session(small_session)


@pytest.fixture(scope="module")
def images(session):
    """Return one frame of every stage."""
    stages = ("checkerboard", "top_pose", "mirror", "whiteboard", "background", "balls")
    frames = {stage: frame(read_linear_image(session.files(stage)[0])) for stage in stages}
    frames["press"] = frame(read_linear_image(session.folder / "presses" / "cylinder_s5_d100.png"))
    return frames


@pytest.fixture(scope="module")
def known(session, images):
    """Return the results of a perfect calibration of the virtual sensor."""
    truth = json.loads((session.folder / "truth.json").read_text("utf-8"))
    optics, top = truth["camera"], truth["top_plane"]
    height, width = images["mirror"].shape[:2]
    pinhole = (optics[key] for key in ("fx", "fy", "cx", "cy"))
    camera = CameraModel(width, height, *pinhole, (*optics["k1_k2_p1_p2"], 0.0))
    plane = TopPlane(tuple(top["normal_camera"]), top["offset_mm"])
    stack, diameter_mm = sensor_stack(session.sensor, plane), session.sensor.working_diameter_mm
    table = build_resampling_table(camera, plane, stack, working_diameter_mm=diameter_mm)
    leds = plane.to_sensor(np.array([truth["leds"][name]["camera_mm"] for name in "RGB"]))
    return Known(camera, plane, table, leds, np.array(truth["crosstalk_camera_from_led"]))


@pytest.fixture(scope="module")
def setting(session, known):
    """Return the setting of the ball stage."""
    background, table = session.averaged("background"), known.table
    bare = unmix(table.apply(background.rgb), known.crosstalk)
    leds_mm, crosstalk = known.led_positions_mm, known.crosstalk
    return BallDetectionInputs(table, leds_mm, crosstalk, bare, background.size)


@pytest.mark.function("See the detected checkerboard on the live image")
def test_a_board_is_marked_on_its_true_corners(tilted):
    seen = detect_board(tilted, BOARD)
    assert seen.ready
    crosses = [(m.u, m.v) for m in seen.overlay.markers if m.kind == "plus"]
    truth = true_corners(CAMERA, board_pose(tilt_deg=25.0, towards_deg=30.0))
    away = np.linalg.norm(np.array(crosses)[:, None] - truth[None], axis=2).min(axis=1)
    assert len(crosses) == 54
    assert away.max() < 0.2
    blurred = detect_board(cv2.GaussianBlur(tilted, (0, 0), 4.0), BOARD)
    assert not blurred.ready and "blurred" in blurred.sentence


@pytest.mark.function("Be asked for the lens view that is missing")
def test_the_next_view_is_requested_where_no_corners_are():
    seen = detect_board(board_frame(tilt_deg=20.0, centre_mm=(-6.0, -4.0), distance_mm=60.0), BOARD)
    assert seen.ready
    assert "bottom right" in seen.sentence or "top right" in seen.sentence


def test_after_two_flat_views_a_tilted_one_is_requested():
    flat = [
        find_board(as_image(board_frame(tilt_deg=2.0, roll_deg=roll)), BOARD)
        for roll in (5.0, 40.0)
    ]
    third = board_frame(tilt_deg=2.0, roll_deg=-30.0)
    assert "Tilt it more" in detect_board(third, BOARD, earlier=flat).sentence
    assert not detect_board(third, BOARD, earlier=flat).ready
    assert detect_board(third, BOARD, earlier=flat[:1]).ready


@pytest.mark.function("Find the pose of the top surface from a board")
def test_the_board_on_top_gives_the_pose_of_the_surface(images, session, known):
    seen = detect_top_pose(images["top_pose"], session.top_pose, known.camera)
    assert seen.ready
    assert f"{known.plane.distance_mm:.1f}" in seen.sentence
    origin = next(m for m in seen.overlay.markers if m.text == "origin")
    expected = known.camera.project(known.plane.origin_camera_mm)
    assert (origin.u, origin.v) == pytest.approx(tuple(expected), abs=1.0)


def test_mirror_spots_are_found_where_the_leds_are_mirrored(images, known):
    expected = mirror_positions_px(known.camera, known.plane, known.led_positions_mm)
    seen = detect_mirror(images["mirror"], expected_px=expected, editable=True)
    assert seen.ready
    handles = {m.handle: (m.u, m.v) for m in seen.overlay.markers if m.handle}
    assert sorted(handles) == ["mirror.0", "mirror.1", "mirror.2"]
    for k in range(3):
        assert handles[f"mirror.{k}"] == pytest.approx(tuple(expected[k]), abs=0.3)
        row, column = round(handles[f"mirror.{k}"][1]), round(handles[f"mirror.{k}"][0])
        assert seen.overlay.masks[k].area[row, column]
    elsewhere = expected[[1, 0, 2]]
    assert "spot offset" in detect_mirror(images["mirror"], expected_px=elsewhere).sentence


@pytest.mark.function("See what is wrong with a white board before the capture")
def test_a_saturated_whiteboard_is_rejected_and_marked(images, known):
    good = detect_whiteboard(images["whiteboard"], table=known.table)
    assert good.ready, good.sentence
    assert all(mask.role != "bad" for mask in good.overlay.masks)
    hot = np.clip(images["whiteboard"].astype(int) * 2, 0, 255).astype(np.uint8)
    bad = detect_whiteboard(hot, table=known.table)
    assert not bad.ready
    assert "Shorten the exposure" in bad.sentence
    np.testing.assert_array_equal(bad.overlay.masks[0].area, (hot == 255).any(axis=2))


def test_a_missing_led_is_named(images, known):
    dark = images["whiteboard"].copy()
    dark[..., 1] = 0
    for seen in (
        detect_whiteboard(dark, table=known.table),
        detect_background(dark, table=known.table),
    ):
        assert not seen.ready
        assert "green" in seen.sentence


@pytest.mark.function("See whether the membrane is bare")
def test_a_bare_membrane_is_ready_and_a_pressed_one_is_not(images, known):
    table, white = known.table, images["whiteboard"]
    bare = detect_background(images["background"], table=table, whiteboard=white)
    assert bare.ready, bare.sentence
    for pressed in ("balls", "press"):
        seen = detect_background(images[pressed], table=table, whiteboard=white)
        assert not seen.good
        assert "Remove anything that touches" in seen.sentence


def test_a_ball_is_circled_at_its_position(images, setting, session, known):
    radius_mm = session.ball_radius_mm(session.files("balls")[0].name)
    seen = detect_open_ball(
        images["balls"],
        setting,
        radius_mm=radius_mm,
        marks=press_marks([(9.0, 9.0)]),
        editable=True,
    )
    assert seen.ready, seen.sentence
    (circle,) = seen.overlay.circles
    assert circle.handle == "ball"
    # The raw image changes inside the contact, and hardly outside of its surroundings.
    change = np.abs(images["balls"].astype(int) - images["background"]).sum(axis=2)
    v, u = np.mgrid[: change.shape[0], : change.shape[1]]
    away = np.hypot(u - circle.u, v - circle.v) / circle.radius_px
    assert change[away < 1.0].mean() > 10.0 * change[(away > 2.5) & (away < 4.0)].mean()
    rim, contour, fitted = seen.overlay.lines
    assert rim.role == "info"
    for line in (contour, fitted):
        radius = np.hypot(*(line.points - (circle.u, circle.v)).T)
        assert radius == pytest.approx(circle.radius_px, rel=0.1)
    assert [m.kind for m in seen.overlay.markers] == ["dot"]
    # The background step marks the same press.
    pressed = detect_background(images["balls"], table=known.table, whiteboard=images["whiteboard"])
    rows, columns = np.nonzero(pressed.overlay.masks[0].area)
    assert np.hypot(columns.mean() - circle.u, rows.mean() - circle.v) < 0.5 * circle.radius_px


WRONG = {
    "checkerboard": ("mirror", "whiteboard", "balls"),
    "top_pose": ("background",),
    "mirror": ("checkerboard", "whiteboard", "balls"),
    "whiteboard": ("checkerboard", "mirror"),
    "background": ("mirror", "top_pose"),
    "balls": ("background", "mirror", "checkerboard", "press"),
}


def detect_in(
    stage: str, rgb: np.ndarray, session: Session, known: Known, setting: BallDetectionInputs
) -> Detection:
    """Return the detection of a stage in a frame."""
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
            return detect_open_ball(rgb, setting, radius_mm=3.0)


@pytest.mark.parametrize("stage", WRONG)
def test_the_image_of_another_stage_is_rejected_with_a_sentence(
    stage, images, session, known, setting
):
    for shown in WRONG[stage]:
        seen = detect_in(stage, images[shown], session, known, setting)
        assert not seen.ready, shown
        assert seen.sentence.endswith(".")


def test_a_board_left_in_place_of_the_mirror_is_named_not_the_grey_image(session):
    board = render_board(CAMERA, board_pose(tilt_deg=5.0, towards_deg=30.0))
    image = replace(board, rgb=np.repeat(board.rgb[..., :1], 3, axis=2))
    with pytest.raises(InputError, match="checkerboard is still in the image"):
        require_lit_colours(image, replace(session, checkerboard=BOARD), where="mirror")
