"""Boards whose squares are longer along one side are named; pixels that are not square are not."""

from collections.abc import Sequence

import numpy as np
import pytest
from boards import BOARD, CAMERA, board_pose, render_board

from gelpolight_core.base.finding import Verdict
from gelpolight_core.base.root_causes import cause_and_rest
from gelpolight_core.calibration.open_sensor_recipe import LENS, TOP_POSE
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.checkerboard import BoardView
from gelpolight_core.stages.checkerboards.lens import calibrate_lens
from gelpolight_core.stages.checkerboards.lens_fit import solve_from_scratch
from gelpolight_core.stages.checkerboards.lens_views import LensRefusal
from gelpolight_core.stages.checkerboards.square_ratio import (
    SquareRatio,
    fit_square_ratio,
    judge_square_ratio,
)
from gelpolight_core.stages.checkerboards.top_surface_pose import estimate_top_pose

TOP_BOARD = BoardSpec((9, 6), 2.0)
# Tilt, its direction, and turn in the image, in degrees.
HELD = [(5, 0, -8), (28, 20, 6), (30, 95, -4), (25, 160, 9), (32, 230, 2), (22, 300, -12)]


def stretched(pose: tuple[np.ndarray, np.ndarray], ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose in which a board is drawn with rows at this share of their distance."""
    return pose[0] / np.array([1.0, ratio, 1.0]), pose[1]


def view(number: int, ratio: float = 1.0) -> LinearImage:
    """Return the numbered view of the board of the lens."""
    tilt_deg, towards_deg, roll_deg = HELD[number]
    pose = board_pose(
        tilt_deg=tilt_deg, towards_deg=towards_deg, roll_deg=roll_deg, distance_mm=50.0
    )
    return render_board(CAMERA, stretched(pose, ratio), name=f"view_{number}.png")


def corners(
    camera: CameraModel,
    seed: int,
    *,
    ratio: float = 1.0,
    bend_mm: float = 0.0,
    held: Sequence[tuple[float, float, float]] = HELD,
) -> list[BoardView]:
    """Return what is found in all views, with an error of the corners of 0.03 px."""
    random, found = np.random.default_rng(seed), []
    for tilt_deg, towards_deg, roll_deg in held:
        pose = board_pose(
            tilt_deg=tilt_deg, towards_deg=towards_deg, roll_deg=roll_deg, distance_mm=50.0
        )
        points = BOARD.points_mm * np.array([1.0, ratio, 1.0])
        points[:, 2] = bend_mm * (points[:, 0] / points[:, 0].max() - 0.5) ** 2 * 4.0
        px = camera.project(points @ pose[0].T + pose[1])
        px += random.normal(0.0, 0.03, px.shape)
        found.append(BoardView("", BOARD, (480, 360), px, 0.0, 0.0, 25.0, 2.0, 0.7, 0.0, 0.0))
    return found


def fitted(camera: CameraModel, seed: int, **board: float) -> SquareRatio:
    """Return the ratio that such views show."""
    return fit_square_ratio(corners(camera, seed, **board), camera, lens_known=False)


def test_a_stretched_board_of_the_lens_is_refused_as_what_it_is():
    views = [view(number, 0.98) for number in range(len(HELD))]
    with pytest.raises(LensRefusal, match=r"Squares of the board are 3\.00 x 2\.94 mm"):
        calibrate_lens(views, BOARD)


def test_a_stretched_board_on_the_top_surface_is_the_first_cause():
    pose = board_pose(tilt_deg=1.5, towards_deg=40.0, distance_mm=39.0, board=TOP_BOARD)
    image = render_board(CAMERA, stretched(pose, 0.98), board=TOP_BOARD)
    quality = estimate_top_pose([image], TOP_BOARD, CAMERA).quality
    figure = quality["squares_percent"]
    assert figure.verdict is Verdict.FAIL
    assert "2.00 x 1.96 mm" in figure.text
    assert figure.value == pytest.approx(2.0, abs=0.1)
    assert figure.remedy in cause_and_rest({"top_pose": quality})[0]


@pytest.mark.parametrize("ratio", [0.97, 0.993, 1.0, 1.02])
def test_the_ratio_is_found_within_its_standard_deviation(ratio):
    errors = []
    for seed in range(8):
        found = fitted(CAMERA, seed, ratio=ratio)
        errors.append((found.value - ratio) / found.sd)
        assert found.sd < 5e-4
    # The longer the board is off, the less the lens that it is compared with is its best fit.
    assert np.sqrt(np.mean(np.square(errors))) < 2.0


def test_pixels_that_are_not_square_and_bent_boards_are_no_stretched_boards():
    squeezed = CameraModel(480, 360, 520.0, 487.0, 243.2, 176.4)
    for seed in range(4):
        assert fitted(squeezed, seed).value == pytest.approx(1.0, abs=2e-3)
        bent = fitted(CAMERA, seed, bend_mm=0.1)
        assert abs(bent.value - 1.0) < max(3.0 * bent.sd, 0.005)


@pytest.mark.parametrize("held", [[(0, 0, 0)] * 5, [(a, 0, 0) for a in (10, 20, 30, -20, -30)]])
def test_views_that_cannot_tell_blame_no_board(held):
    """Boards that face the camera, or all tilt about one axis, are as stretched as the pixels."""
    for seed in range(12):
        views = corners(CAMERA, seed, held=held)
        fx, fy, cx, cy, *bent, _ = map(float, solve_from_scratch(views, (480, 360)).values)
        camera = CameraModel(480, 360, fx, fy, cx, cy, (*bent, 0.0))
        ratio = fit_square_ratio(views, camera, lens_known=False)
        assert judge_square_ratio(ratio, BOARD) == ()


def test_rendered_boards_are_square(rendered_optics):
    results = rendered_optics("sensor-B")
    for stage in (LENS, TOP_POSE):
        keys = [figure.key for figure in results[stage].quality.figures]
        assert "squares_percent" not in keys
    camera = results[LENS].camera
    views = [view.board for view in results[LENS].views if view.used]
    assert fit_square_ratio(views, camera, lens_known=False).value == pytest.approx(1.0, abs=2e-4)
