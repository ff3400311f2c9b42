"""The top surface is found from a board that lies on it, and the mirrored pose is rejected."""

import json

import numpy as np
import pytest
from boards import CAMERA, board_pose, render_board
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.open_sensor_recipe import TOP_POSE
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.plane_pose import PlanePose, find_poses
from gelpolight_core.stages.checkerboards.top_surface_pose import TopPoseResult, estimate_top_pose

BOARD = BoardSpec((9, 6), 2.0)


def lying_board(
    *,
    tilt_deg: float = 1.5,
    towards_deg: float = 40.0,
    roll_deg: float = 8.0,
    distance_mm: float = 39.0,
    centre_mm: tuple[float, float] = (0.3, -0.2),
    camera: CameraModel = CAMERA,
    name: str = "top.png",
    noise: float = 0.004,
    blur_px: float = 0.6,
) -> tuple[LinearImage, TopPlane]:
    """Return the image of a board and the plane in which it lies."""
    rotation, shift = board_pose(
        tilt_deg=tilt_deg,
        towards_deg=towards_deg,
        roll_deg=roll_deg,
        distance_mm=distance_mm,
        centre_mm=centre_mm,
        board=BOARD,
    )
    image = render_board(
        camera, (rotation, shift), board=BOARD, name=name, noise=noise, blur_px=blur_px
    )
    x, y, z = (float(n) for n in rotation[:, 2])
    return image, TopPlane((x, y, z), float(rotation[:, 2] @ shift))


def angle_deg(plane: TopPlane, other: TopPlane) -> float:
    """Return the angle between two planes."""
    across = np.cross(plane.normal_camera, other.normal_camera)
    return float(np.degrees(np.arcsin(np.linalg.norm(across))))


# Squares parallel to the pixel rows: the corner errors are equal and do not average out.
@example(tilt_deg=2.93, towards_deg=0.0, roll_deg=0.0, distance_mm=35.759)
@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    tilt_deg=st.floats(0.0, 8.0),
    towards_deg=st.floats(0.0, 360.0),
    roll_deg=st.floats(-180.0, 180.0),
    distance_mm=st.floats(32.0, 55.0),
)
def test_the_surface_is_found_however_it_is_mounted(tilt_deg, towards_deg, roll_deg, distance_mm):
    """Distance to 0.1 %, normal to 0.1 degrees, and both within the stated uncertainty."""
    image, truth = lying_board(
        tilt_deg=tilt_deg, towards_deg=towards_deg, roll_deg=roll_deg, distance_mm=distance_mm
    )
    result = estimate_top_pose([image], BOARD, CAMERA)
    assert result.plane.distance_mm == pytest.approx(truth.distance_mm, rel=1e-3)
    # Squares of 19 px at 55 mm give a third of the accuracy of the rendered sessions.
    assert angle_deg(result.plane, truth) < 0.2
    assert angle_deg(result.plane, truth) < 5.0 * result.normal_sd_deg
    # An error of 1/50 pixel common to all corners of a board of 200 px does not appear as scatter.
    common_mm = 1e-4 * truth.distance_mm
    away_mm = abs(result.plane.distance_mm - truth.distance_mm)
    assert away_mm < 5.0 * result.distance_sd_mm + common_mm
    assert result.plane.normal_camera[2] > 0.9


def mirrored_pose(result: TopPoseResult, camera: CameraModel) -> PlanePose:
    """Return the pose of the first board that was rejected."""
    board = result.views[0].board
    assert board is not None
    return max(find_poses(board, camera), key=lambda pose: angle_deg(pose.plane, result.plane))


def test_the_mirrored_pose_is_rejected_with_a_margin():
    """One of the two poses of a flat board is accepted, with the evidence against the other."""
    image, truth = lying_board(tilt_deg=6.0)
    result = estimate_top_pose([image], BOARD, CAMERA)
    (view,) = result.views
    assert angle_deg(result.plane, truth) < 0.1
    mirrored = mirrored_pose(result, CAMERA)
    assert angle_deg(mirrored.plane, truth) > 3.0
    assert mirrored.rms_px > 3.0 * view.pose.rms_px
    margin = result.quality["mirrored_margin"]
    assert margin.value > 5.0 and margin.verdict is Verdict.PASS


def far_camera() -> CameraModel:
    """Return a long lens: at a large distance a board has hardly any perspective."""
    return CameraModel(320, 240, 120000.0, 120000.0, 160.0, 120.0)


def test_two_poses_that_fit_equally_well_are_reported():
    """At a large distance and with noise, nothing separates the poses; the result says so."""
    image, truth = lying_board(
        tilt_deg=6.0, distance_mm=10000.0, camera=far_camera(), noise=0.03, blur_px=1.0
    )
    result = estimate_top_pose([image], BOARD, far_camera())
    mirrored = mirrored_pose(result, far_camera())
    assert result.quality["mirrored_margin"].verdict is Verdict.WARN
    assert result.tilt_deg <= mirrored.tilt_deg
    nearest = min(angle_deg(plane, truth) for plane in (result.plane, mirrored.plane))
    assert nearest < 2.0


def test_a_board_that_does_not_lie_flat_is_left_out_and_named():
    """A particle under one of three boards does not tilt the result."""
    flat = [lying_board(roll_deg=roll, name=f"flat_{roll:.0f}.png") for roll in (-40.0, 10.0, 70.0)]
    propped, _ = lying_board(tilt_deg=4.0, towards_deg=200.0, name="propped.png")
    result = estimate_top_pose([*(image for image, _ in flat), propped], BOARD, CAMERA)
    assert [view.name for view in result.views if not view.used] == ["propped.png"]
    assert "propped.png" in result.quality["views_left_out"].remedy
    assert angle_deg(result.plane, flat[0][1]) < 0.1


def test_boards_of_which_no_two_agree_are_refused_and_named():
    """Images of a hand-held board, copied here, give no information about the surface.

    One of three such boards may happen to be in the middle; even then there is no evidence for it.
    """
    images = [
        lying_board(tilt_deg=tilt, distance_mm=38.0 + 2.0 * k, name=f"held_{k}.png")[0]
        for k, tilt in enumerate((0.0, 12.0, 24.0))
    ]
    with pytest.raises(InputError, match=r"The 3 boards .* plane") as refusal:
        estimate_top_pose(images, BOARD, CAMERA)
    assert refusal.value.where == "top_pose"
    assert "held_0.png" in refusal.value.found


def test_the_focal_length_s_uncertainty_reaches_the_distance():
    """The distance cannot be known better than the focal length."""
    image, _ = lying_board()
    result = estimate_top_pose([image], BOARD, CAMERA, focal_sd_px=0.01 * CAMERA.fx)
    assert result.distance_sd_mm >= 0.01 * result.plane.distance_mm
    assert result.quality["distance_sd"].verdict is not Verdict.PASS


def test_without_a_usable_image_the_reason_is_given():
    """If there is only one image, its error is the error of the stage."""
    image, _ = lying_board()
    with pytest.raises(InputError, match="no image"):
        estimate_top_pose([], BOARD, CAMERA)
    black = LinearImage("top_pose.png", np.zeros_like(image.rgb))
    with pytest.raises(InputError, match="black") as refusal:
        estimate_top_pose([black], BOARD, CAMERA)
    assert refusal.value.where == "top_pose/top_pose.png"
    with pytest.raises(InputError, match="480x200"):
        estimate_top_pose([LinearImage("cut.png", image.rgb[:200])], BOARD, CAMERA)


@pytest.mark.parametrize(
    ("sensor", "normal_deg"),
    [("sensor-B", 0.1), pytest.param("sensor-A", 0.05, marks=pytest.mark.long)],
)
def test_rendered_sessions_give_the_surface_with_our_own_lens(
    shared_data, rendered_optics, sensor, normal_deg
):
    """0.1 % of the distance is 0.1 % of every length; 0.1 degrees moves a light by 0.1 mm."""
    truth = json.loads((shared_data / sensor / "truth.json").read_text("utf-8"))["top_plane"]
    result = rendered_optics(sensor)[TOP_POSE].pose
    x, y, z = truth["normal_camera"]
    plane = TopPlane((x, y, z), truth["offset_mm"])
    assert result.plane.distance_mm == pytest.approx(plane.distance_mm, rel=1e-3)
    assert angle_deg(result.plane, plane) < normal_deg
    assert result.quality.verdict is Verdict.PASS


@pytest.mark.parametrize("blur_px", [0.6, 1.05])
def test_the_blur_on_the_surface_is_measured(blur_px):
    """With the width of a pixel, which a square aperture of one pixel has."""
    image, _ = lying_board(blur_px=blur_px)
    result = estimate_top_pose([image], BOARD, CAMERA)
    assert result.blur_px == pytest.approx(np.hypot(blur_px, 1.0 / np.sqrt(12.0)), abs=0.06)
    assert result.quality["blur"].verdict is (Verdict.PASS if blur_px < 1.0 else Verdict.WARN)
