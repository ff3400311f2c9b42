"""A checkerboard is located to a few hundredths of a pixel, and nothing else is accepted as one."""

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, board_pose, render_board, true_corners
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.checkerboard import find_board

Array = NDArray[np.float64]


def distance_to_nearest(corners: Array, truth: Array) -> Array:
    """Return each corner's distance to the nearest true corner (the order may be reversed)."""
    return np.asarray(np.linalg.norm(corners[:, None] - truth[None], axis=2).min(axis=1))


@pytest.fixture(scope="module")
def tilted_board():
    """Return a sharp view of the 9 x 6 board, tilted by 20 degrees."""
    return render_board(CAMERA, board_pose(tilt_deg=20.0, towards_deg=30.0))


@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    tilt_deg=st.floats(0.0, 35.0),
    towards_deg=st.floats(0.0, 360.0),
    roll_deg=st.floats(-180.0, 180.0),
    distance_mm=st.floats(45.0, 60.0),
)
def test_corners_are_found_in_any_pose(tilt_deg, towards_deg, roll_deg, distance_mm):
    """The technician may hold the board in any pose: tilted, rotated, near or far."""
    pose = board_pose(
        tilt_deg=tilt_deg, towards_deg=towards_deg, roll_deg=roll_deg, distance_mm=distance_mm
    )
    view = find_board(render_board(CAMERA, pose, fine=3), BOARD)
    off = distance_to_nearest(view.corners_px, true_corners(CAMERA, pose))
    # A focal length to 0.1 % needs 0.1 px on squares of 20 to 35 px; this is twice as good.
    assert np.sqrt(np.mean(off**2)) < 0.05
    assert off.max() < 0.2
    assert view.tilt_deg == pytest.approx(tilt_deg, abs=12.0)


def test_corners_come_row_by_row_as_seen_from_the_printed_side(tilted_board):
    """An overlay draws the grid along its rows; no row may be swapped or mirrored."""
    view = find_board(tilted_board, BOARD)
    grid = view.corners_px.reshape(6, 9, 2)
    along, down = grid[:, 1:] - grid[:, :-1], grid[1:] - grid[:-1]
    turn = along[:-1, :, 0] * down[:, :-1, 1] - along[:-1, :, 1] * down[:, :-1, 0]
    assert (turn > 0.0).all()
    size = np.linalg.norm(along, axis=-1)
    assert size.max() < 1.6 * size.min()


@pytest.mark.parametrize("stated", [(8, 5), (7, 7), (10, 7), (5, 4)])
def test_another_board_size_is_refused_and_the_real_one_named(tilted_board, stated):
    """A board of another size would give a wrong camera; the message names the mistake."""
    with pytest.raises(InputError, match=r"9 x 6 inner corners, not") as refusal:
        find_board(tilted_board, BoardSpec(stated, 3.0))
    assert refusal.value.where == "view.png"
    assert refusal.value.advice == Remedy.BOARD_SIZE


def test_uneven_light_does_not_move_the_corners(tilted_board):
    """A lamp at one side is not an error of the lens."""
    straight = find_board(tilted_board, BOARD).corners_px
    falloff = np.linspace(0.25, 1.2, 480, dtype=np.float32)[None, :, None]
    shaded = LinearImage("shaded.png", np.clip(tilted_board.rgb * falloff, 0.0, 0.99))
    assert distance_to_nearest(find_board(shaded, BOARD).corners_px, straight).max() < 0.1


def flat(value: float) -> LinearImage:
    """Return an image with a single value."""
    return LinearImage("flat.png", np.full((360, 480, 3), value, dtype=np.float32))


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (flat(0.0), "black"),
        (flat(0.01), "black"),
        (flat(1.0), "saturated"),
        (flat(0.5), "same brightness"),
        (flat(float("nan")), "no valid value"),
    ],
)
def test_an_empty_image_is_refused_with_the_reason(image, says):
    """The advice depends on the kind of exposure error."""
    with pytest.raises(InputError, match=says):
        find_board(image, BOARD)


@pytest.mark.parametrize("blur_px", [2.5, 5.0, 12.0])
def test_a_blurred_board_is_refused_as_blurred(tilted_board, blur_px):
    """A defocused or moved image is reported as blurred, not as a missing board."""
    blurred = np.asarray(cv2.GaussianBlur(tilted_board.rgb, (0, 0), blur_px))
    with pytest.raises(InputError, match="blurred: edges are"):
        find_board(LinearImage("blurred.png", blurred), BOARD)


@pytest.mark.parametrize(
    ("corners", "square_mm"), [((2, 6), 3.0), ((9, 6), 0.0), ((9, 6), float("nan"))]
)
def test_an_impossible_board_is_refused(corners, square_mm):
    """A typing error in the session is found before any image is read."""
    with pytest.raises(InputError):
        BoardSpec(corners, square_mm)


def test_wrong_sizes_never_pass_on_a_rendered_session(shared_data):
    """The board of the independent renderer is found, and only with its own size."""
    path = shared_data / "sensor-B" / "top_pose" / "top_pose.png"
    rgb = cv2.imread(str(path))[:, :, ::-1].astype(np.float32) / np.float32(255.0)
    image = LinearImage(path.name, rgb)
    assert find_board(image, BOARD).grid_rms_px < 0.1
    for stated in [(8, 5), (7, 7), (5, 4), (3, 3), (10, 6)]:
        with pytest.raises(InputError, match="9 x 6"):
            find_board(image, BoardSpec(stated, 3.0))
