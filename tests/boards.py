"""Images of a printed checkerboard in any pose, traced ray by ray, for tests of lens and pose."""

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec

Array = NDArray[np.float64]

BOARD = BoardSpec((9, 6), 3.0)
CAMERA = CameraModel(480, 360, 520.0, 520.0, 243.2, 176.4, (-0.12, 0.05, 0.0006, -0.0004, 0.0))


def board_pose(
    *,
    tilt_deg: float = 0.0,
    towards_deg: float = 0.0,
    roll_deg: float = 5.0,
    distance_mm: float = 45.0,
    centre_mm: tuple[float, float] = (0.0, 0.0),
    board: BoardSpec = BOARD,
) -> tuple[Array, Array]:
    """Return rotation and shift (mm) of a board whose middle is at a place before the camera."""
    towards = np.radians(towards_deg)
    axis = np.array([-np.sin(towards), np.cos(towards), 0.0]) * np.radians(tilt_deg)
    roll = np.array([0.0, 0.0, np.radians(roll_deg)])
    rotation = np.asarray(cv2.Rodrigues(axis)[0]) @ np.asarray(cv2.Rodrigues(roll)[0])
    middle = board.points_mm.mean(axis=0)
    return rotation, np.array([*centre_mm, distance_mm]) - rotation @ middle


def true_corners(camera: CameraModel, pose: tuple[Array, Array], board: BoardSpec = BOARD) -> Array:
    """Return the (N, 2) pixels of the corners of a board in a pose."""
    return camera.project(board.points_mm @ pose[0].T + pose[1])


def render_board(
    camera: CameraModel,
    pose: tuple[Array, Array],
    *,
    board: BoardSpec = BOARD,
    name: str = "view.png",
    blur_px: float = 0.6,
    noise: float = 0.004,
    fine: int = 2,
) -> LinearImage:
    """Trace fine x fine rays per pixel onto a printed board: white 0.8, black 0.05, around 0.25."""
    u, v = np.meshgrid(np.arange(-1.0, camera.width + 1), np.arange(-1.0, camera.height + 1))
    rays = camera.directions(np.stack([u, v], axis=-1))[..., :2]
    # Between pixel centres the directions are linear to 1e-6: only they are traced in full.
    place = [(np.arange(n * fine) + 0.5) / fine + 0.5 for n in (camera.width, camera.height)]
    # Jittered within their cells: a regular grid would see edges along it a quarter pixel off.
    rng = np.random.default_rng(7)
    maps = [
        (m + rng.uniform(-0.5, 0.5, m.shape) / fine).astype(np.float32) for m in np.meshgrid(*place)
    ]
    x, y = (cv2.remap(rays[..., k], *maps, interpolation=cv2.INTER_LINEAR) for k in (0, 1))
    rotation, shift = pose
    normal = rotation[:, 2]
    scale = (normal @ shift) / (normal[0] * x + normal[1] * y + normal[2])
    hit = [
        (axis[0] * x + axis[1] * y + axis[2]) * scale - axis @ shift
        for axis in (rotation[:, 0], rotation[:, 1])
    ]
    across, down = (np.floor(side / board.square_mm).astype(int) + 1 for side in hit)
    squares = [n + 1 for n in board.inner_corners]
    on_squares = (across >= 0) & (across < squares[0]) & (down >= 0) & (down < squares[1])
    on_paper = (across >= -1) & (across <= squares[0]) & (down >= -1) & (down <= squares[1])
    light = np.where(on_squares & ((across + down) % 2 == 0), 0.05, np.where(on_paper, 0.8, 0.25))
    grey = light.reshape(camera.height, fine, camera.width, fine).mean(axis=(1, 3))
    if blur_px > 0.0:
        grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), blur_px))
    rgb = grey[..., None] + rng.normal(0.0, noise, (*grey.shape, 3))
    return LinearImage(name, (np.round(np.clip(rgb, 0.0, 1.0) * 255.0) / 255.0).astype(np.float32))
