"""The lens calibration finds the camera and its uncertainty, and refuses unusable views."""

import json

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, board_pose, render_board

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.open_sensor_recipe import LENS
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.stages.checkerboards.lens import calibrate_lens, find_nonsense
from gelpolight_core.stages.checkerboards.lens_views import LensRefusal

# Tilt, its direction, distance, and position of the board centre: as held by a technician.
HELD = [
    (5.0, 0.0, 45.0, (0.0, 0.0)),
    (28.0, 20.0, 50.0, (-5.0, -3.0)),
    (30.0, 95.0, 52.0, (5.0, -3.0)),
    (25.0, 160.0, 50.0, (5.0, 3.0)),
    (32.0, 230.0, 52.0, (-5.0, 3.0)),
    (22.0, 300.0, 47.0, (0.0, 2.0)),
    (35.0, 60.0, 54.0, (-2.0, -4.0)),
    (26.0, 200.0, 48.0, (2.0, 1.0)),
    (18.0, 340.0, 46.0, (1.0, -1.0)),
]


def held_view(number: int, camera: CameraModel = CAMERA, **changes: float) -> LinearImage:
    """Return the numbered view of the board."""
    tilt_deg, towards_deg, distance_mm, centre_mm = HELD[number]
    pose = board_pose(
        tilt_deg=tilt_deg,
        towards_deg=towards_deg,
        roll_deg=7.0 * number - 20.0,
        distance_mm=distance_mm,
        centre_mm=centre_mm,
    )
    return render_board(camera, pose, name=f"view_{number:02}.png", **changes)


@pytest.fixture(scope="module")
def views():
    """Return nine good views."""
    return [held_view(number) for number in range(len(HELD))]


@pytest.fixture(scope="module")
def lens(views):
    """Return the lens calibrated from the nine views."""
    return calibrate_lens(views, BOARD)


def test_the_camera_is_found_within_its_stated_uncertainty(lens):
    """The stated uncertainty matches the actual errors."""
    camera = lens.camera
    assert camera.fx == pytest.approx(CAMERA.fx, rel=1e-3)
    values = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion[:4]])
    truth = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, *CAMERA.distortion[:4]])
    # Four standard deviations in eight figures: by chance only once in two thousand.
    assert (np.abs(values - truth) < 4.0 * lens.sd[:8]).all()
    assert lens.sd[0] < 1e-3 * CAMERA.fx
    # A common focal length is known better than two separate ones.
    assert camera.fx == camera.fy
    rms_px = lens.quality["reprojection_rms"].value
    assert rms_px < 0.06
    assert rms_px < lens.quality["held_out_rms"].value < 1.5 * rms_px


def test_pixels_that_are_not_square_are_noticed():
    """A camera with non-square pixels is not forced to square pixels."""
    squeezed = CameraModel(480, 360, 520.0, 510.0, 243.2, 176.4)
    lens = calibrate_lens([held_view(number, squeezed) for number in range(6)], BOARD)
    assert lens.camera.fx / lens.camera.fy == pytest.approx(520.0 / 510.0, rel=1e-3)


def test_a_bad_view_among_good_ones_is_left_out_and_named(views):
    """One mistake costs one view, not the session."""
    moved = LinearImage("moved.png", np.asarray(cv2.GaussianBlur(views[2].rgb, (0, 0), 4.0)))
    dark = LinearImage("dark.png", np.zeros_like(views[0].rgb))
    again = LinearImage("again.png", views[4].rgb)
    lens = calibrate_lens([*views[:7], moved, dark, again], BOARD)
    reasons = {view.name: view.reason for view in lens.views if not view.used}
    assert reasons.keys() == {"moved.png", "dark.png", "again.png"}
    assert "blurred" in reasons["moved.png"]
    assert "black" in reasons["dark.png"]
    assert "view_04.png" in reasons["again.png"]
    assert lens.quality["views_left_out"].verdict is Verdict.WARN
    assert "moved.png" in lens.quality["views_left_out"].remedy
    assert lens.camera.fx == pytest.approx(CAMERA.fx, rel=2e-3)


def test_a_bent_board_is_left_out_by_its_error(views):
    """A view that fits no camera affects all figures; it is named with its error."""
    rows, columns = np.mgrid[0:360, 0:480].astype(np.float32)
    wavy = (columns + 0.6 * np.sin(rows / 40.0)).astype(np.float32)
    bent = LinearImage(
        "bent.png", np.asarray(cv2.remap(views[3].rgb, wavy, rows, cv2.INTER_LINEAR))
    )
    lens = calibrate_lens([*views[:3], bent, *views[4:]], BOARD)
    assert [view.name for view in lens.views if not view.used] == ["bent.png"]
    assert "typical view" in lens.views[3].reason
    assert lens.camera.fx == pytest.approx(CAMERA.fx, rel=2e-3)


def test_three_views_are_not_enough(views):
    """Any camera fits three views; nothing would check it."""
    with pytest.raises(InputError, match="3 images, but at least 4"):
        calibrate_lens(views[:3], BOARD)


def test_parallel_views_are_refused_for_want_of_a_focal_length():
    """Views of an untilted board look the same for any focal length."""
    images = [
        render_board(CAMERA, board_pose(tilt_deg=1.0, towards_deg=90.0 * k, distance_mm=44.0 + k))
        for k in range(4)
    ]
    blank = LinearImage("blank.png", np.full((*images[0].rgb.shape[:2], 3), 0.5, np.float32))
    with pytest.raises(LensRefusal, match="nearly parallel") as refusal:
        calibrate_lens([*images, blank], BOARD)
    assert "blank.png" in refusal.value.found, "left-out views are named with their reason"
    assert [view.used for view in refusal.value.views] == [True] * 4 + [False]


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        (
            CameraModel(640, 480, 5115.0, 6346.0, 320.0, 240.0, (0.0, -50494.0, 0.0, 0.0, 0.0)),
            "10 %",
        ),
        (
            CameraModel(640, 480, 5115.0, 5115.0, 320.0, 240.0, (0.0, -50494.0, 0.0, 0.0, 0.0)),
            "folds",
        ),
        (CameraModel(640, 480, 700.0, 700.0, 900.0, 240.0), "principal point"),
        (CameraModel(640, 480, 20.0, 20.0, 320.0, 240.0), "implausible"),
        (CameraModel(640, 480, float("nan"), 700.0, 320.0, 240.0), "not numbers"),
    ],
)
def test_intrinsics_that_no_camera_has_are_recognised(camera, says):
    """The first one is a calibration published by another project."""
    nonsense = find_nonsense(camera)
    assert nonsense is not None
    assert says in nonsense


@pytest.mark.parametrize("sensor", ["sensor-B", pytest.param("sensor-A", marks=pytest.mark.long)])
def test_rendered_sessions_give_the_focal_length_to_a_thousandth(
    shared_data, rendered_optics, sensor
):
    """Every length of the sensor depends on this one."""
    truth = json.loads((shared_data / sensor / "truth.json").read_text("utf-8"))["camera"]
    lens = rendered_optics(sensor)[LENS]
    assert lens.camera.fx == pytest.approx(truth["fx"], rel=1e-3)
    assert lens.camera.fy == pytest.approx(truth["fy"], rel=1e-3)
    # 1 px of the principal point is 0.03 mm on the membrane, and the pose compensates most of it.
    assert np.hypot(lens.camera.cx - truth["cx"], lens.camera.cy - truth["cy"]) < 1.0
    assert lens.quality["held_out_rms"].value < 0.1
    assert lens.quality.verdict is Verdict.PASS
