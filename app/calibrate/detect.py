"""What each calibration stage sees in a frame, live: the core's own detectors, made into marks.

Pure functions from a frame (rows, columns, 3) uint8 or uint16 RGB and earlier results to a
:class:`~app.calibrate.detection.Detection`; nothing is refused by an exception. They run in the
processing thread. What is captured is judged again, and finally, by the stage itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, as_picture, judged, or_refusal
from app.calibrate.marks import (
    LED_ROLES,
    ball_contour,
    ball_handle,
    board_corners,
    board_outline,
    foot_point,
    seen_at,
    spot_markers,
    spot_mask,
    working_rim,
)
from app.live.overlay import Marker, Overlay
from app.live.picture_checks import Rgb
from gelpolight_core.errors import InputError
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.optics.board_exposure import (
    blur_error,
    check_exposure,
    edge_limit_px,
    sharpest_edge_px,
)
from gelpolight_core.optics.board_search import find_rough_corners, search_rough_corners
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.checkerboard import BoardSpec, BoardView, find_board
from gelpolight_core.optics.lens_quality import coverage_counts
from gelpolight_core.optics.pose import estimate_top_pose
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.quality import Figure, judge
from gelpolight_core.reflectance.press import find_ball
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# The slow search looks at so small a copy that a frame without a board stays quick; below 400
# pixels it begins to miss boards that the border cuts off, and then takes longer.
GLANCE_PX = 480
# The lens stage advises 15 to 40 degrees. Below 10 a board is foreshortened by less than 2 %: two
# such views show the distortion, more add little.
LEAST_TILT_DEG = 10.0
FLAT_VIEWS = 2
# A board that tilts by ten degrees to the other side moves its corners by this much, and is
# worth having.
SAME_VIEW_OF_SQUARE = 0.2
# A mirror image this far from its expected place is more than any mounting is off.
LED_OFF_OF_WIDTH = 0.05


def detect_board(
    rgb: Rgb, board: BoardSpec, *, earlier: Sequence[BoardView] = (), patient: bool = False
) -> Detection:
    """Look for a lens view of the checkerboard, and say which view to show next.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    board : BoardSpec
        The board that should be there.
    earlier : sequence of BoardView
        Views that were captured already.
    patient : bool, optional
        Look as long as the stage itself does, up to a second; for stills.
    """
    faint = Overlay(lines=tuple(board_outline(view, "info") for view in earlier))

    def look() -> Detection:
        picture = as_picture(rgb)
        view = find_board(picture, board, rough=None if patient else _glance(picture, board))
        marks = Overlay(
            markers=board_corners(view), lines=(*faint.lines, board_outline(view, "good"))
        )
        text, ready = _next_view(view, earlier)
        return Detection(marks, text, ready, _view_figures(view, earlier), view)

    return or_refusal(look, marks=faint)


def _glance(picture: Picture, board: BoardSpec) -> Array:
    """Return rough corners by the quick detectors, which is not yet a board, or refuse."""
    red, green, blue = cv2.split(picture.rgb)
    grey = np.asarray((red + green + blue) / np.float32(3.0), np.float32)
    check_exposure(grey, picture.name)
    rough = find_rough_corners(grey, board.inner_corners)
    if rough is None:
        rough = search_rough_corners(grey, board.inner_corners, longest_px=GLANCE_PX)
    if rough is not None:
        return rough
    width_px = sharpest_edge_px(grey)
    if width_px > edge_limit_px(picture.size[0]):
        raise blur_error(width_px, edge_limit_px(picture.size[0]), picture.name)
    raise InputError(
        tr("no board found: {w} x {h} inner corners are looked for").format(
            w=board.inner_corners[0], h=board.inner_corners[1]
        ),
        where=picture.name,
        advice=tr("Show the whole board, evenly lit, with a light margin around it"),
    )


def _next_view(view: BoardView, earlier: Sequence[BoardView]) -> tuple[str, bool]:
    """Return what to say about a view that was found, and whether it adds something."""
    if any(_moved_px(view, other) < SAME_VIEW_OF_SQUARE * view.square_px for other in earlier):
        return tr("Board found, but as in an earlier view. Move it or tilt it."), False
    if view.saturated_share > 0.0:
        text = tr(
            "Board found; {p:.0f} % of its light squares are saturated. Shorten the exposure."
        )
        return text.format(p=max(100.0 * view.saturated_share, 1.0)), True
    flat = sum(other.tilt_deg < LEAST_TILT_DEG for other in earlier)
    if view.tilt_deg < LEAST_TILT_DEG and flat >= FLAT_VIEWS:
        text = tr("Board found, tilt it more: {t:.0f} degrees now, 15 to 40 either way are useful.")
        return text.format(t=view.tilt_deg), False
    place = _uncovered_place([*earlier, view])
    if place:
        return tr("Board found. Nothing was seen yet at the {place}.").format(place=place), True
    return tr("Board found. The whole picture is covered."), True


def _moved_px(view: BoardView, other: BoardView) -> float:
    """Return by how much the corners moved, RMS, whichever way round the board lies."""
    if view.corners_px.shape != other.corners_px.shape:
        return float("inf")
    moves = (view.corners_px - other.corners_px, view.corners_px - other.corners_px[::-1])
    return min(float(np.sqrt(np.mean(np.sum(move**2, axis=1)))) for move in moves)


def _uncovered_place(views: Sequence[BoardView]) -> str:
    """Return the name of a ninth of the picture without any corner, corners first; or nothing."""
    names = (
        (tr("top left"), tr("top"), tr("top right")),
        (tr("left"), tr("middle"), tr("right")),
        (tr("bottom left"), tr("bottom"), tr("bottom right")),
    )
    counts = coverage_counts(views, views[0].picture_size)
    rows = [part.sum(axis=0) for part in np.array_split(counts, 3, axis=0)]
    ninths = np.array([[p.sum() for p in np.array_split(row, 3)] for row in rows])
    order = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0), (1, 1))
    return next((names[i][j] for i, j in order if ninths[i, j] == 0), "")


def _view_figures(view: BoardView, earlier: Sequence[BoardView]) -> tuple[Figure, ...]:
    covered = coverage_counts([*earlier, view], view.picture_size) > 0
    return (
        judge("tilt", tr("Tilt"), view.tilt_deg, "deg"),
        judge("edge_width", tr("Edge width"), view.edge_width_px, "px",
              warn=edge_limit_px(view.picture_size[0])),
        judge("grid_rms", tr("Corners off a flat grid"), view.grid_rms_px, "px"),
        judge("contrast", tr("Contrast"), 100.0 * view.contrast, "%"),
        judge("saturated", tr("Saturated light squares"), 100.0 * view.saturated_share, "%",
              warn=0.0),
        judge("coverage", tr("Picture covered by corners"), 100.0 * float(covered.mean()), "%"),
        judge("views", tr("Views captured"), len(earlier)),
    )  # fmt: skip


def detect_top_pose(
    rgb: Rgb, board: BoardSpec, camera: Camera, *, patient: bool = False
) -> Detection:
    """Look for the board on the top surface and say how the surface lies.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    board : BoardSpec
        The board on the surface.
    camera : Camera
        From the lens stage.
    patient : bool, optional
        As for :func:`detect_board`.
    """

    def look() -> Detection:
        picture = as_picture(rgb, tr("frame"))
        if not patient:
            _glance(picture, board)
        pose = estimate_top_pose([picture], board, camera)
        view = pose.views[0].board
        markers = () if view is None else board_corners(view)
        lines = () if view is None else (board_outline(view, "good"),)
        marks = Overlay(markers=(*markers, foot_point(camera, pose.plane)), lines=lines)
        good = tr("Board found: the top surface is {d:.2f} mm away and tilted by {t:.2f} degrees.")
        return judged(
            marks,
            pose.quality.figures,
            good.format(d=pose.plane.distance_mm, t=pose.tilt_deg),
            view,
        )

    return or_refusal(look)


def detect_mirror(
    rgb: Rgb, *, expected_px: Array | None = None, editable: bool = False
) -> Detection:
    """Look for the LEDs' reflections.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    expected_px : (3, 2), optional
        Where the spots should be, from :func:`app.calibrate.marks.mirror_places`.
    editable : bool, optional
        Whether the spots can be dragged; they are called mirror.0, mirror.1 and mirror.2.
    """
    places = () if expected_px is None else tuple(expected_px)
    expected = tuple(
        Marker(float(u), float(v), "ring", "expected", text=tr("expected")) for u, v in places
    )

    def look() -> Detection:
        spots = find_mirror_spots(as_picture(rgb))
        marks = Overlay(
            markers=(*expected, *spot_markers(spots, editable=editable)),
            masks=tuple(
                spot_mask(rgb, spot, role)
                for spot, role in zip(spots.spots, LED_ROLES, strict=True)
            ),
        )
        figures = spots.quality.figures
        if expected_px is not None:
            off = float(np.linalg.norm(spots.centres_px - expected_px, axis=1).max())
            figures += (
                judge("spot_off_px", tr("Farthest spot from its expected place"), off, "px",
                      warn=LED_OFF_OF_WIDTH * rgb.shape[1],
                      advice=tr("Check that each LED has its channel and that the mirror is flat")),
            )  # fmt: skip
        return judged(marks, figures, tr("All three LEDs are found."), spots)

    return or_refusal(look, marks=Overlay(markers=expected))


@dataclass(frozen=True, slots=True)
class BallSetting:
    """What the earlier stages say, as far as a ball press needs it.

    Attributes
    ----------
    table : ResamplingTable
        From lens, top pose and layers.
    led_positions_mm : (3, 3)
        Sensor frame.
    crosstalk : (3, 3)
        Of the mirror stage.
    background : (rows, columns, 3) float32
        The bare membrane, resampled onto the table's grid, crosstalk removed.
    picture_size : (width, height)
        Of the frames.
    """

    table: ResamplingTable
    led_positions_mm: Array
    crosstalk: Array
    background: NDArray[np.float32]
    picture_size: tuple[int, int]


def ball_setting(
    background: Picture, table: ResamplingTable, led_positions_mm: Array, crosstalk: Array
) -> BallSetting:
    """Prepare what does not change from frame to frame."""
    bare = unmix(table.apply(background.rgb), crosstalk)
    return BallSetting(table, led_positions_mm, crosstalk, bare, background.size)


def detect_ball(
    rgb: Rgb,
    setting: BallSetting,
    *,
    radius_mm: float,
    earlier_mm: Sequence[tuple[float, float]] = (),
    editable: bool = False,
) -> Detection:
    """Look for a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    setting : BallSetting
        From :func:`ball_setting`.
    radius_mm : float
        Of the ball.
    earlier_mm : sequence of (x, y)
        Centres of the presses that were captured already, sensor frame.
    editable : bool, optional
        Whether the contact's circle can be dragged; it is called ball.
    """
    table = setting.table
    nodes = table.grid.to_index(np.array(earlier_mm, np.float64).reshape(-1, 2))
    done = tuple(Marker(float(u), float(v), "dot", "info") for u, v in seen_at(table, nodes))
    rim = working_rim(table)

    def look() -> Detection:
        _refuse_size(rgb, setting.picture_size)
        seen = unmix(table.apply(as_picture(rgb).rgb), setting.crosstalk)
        press = find_ball(
            seen,
            setting.background,
            table,
            setting.led_positions_mm,
            radius_mm=radius_mm,
            name=tr("frame"),
        )
        handle = ball_handle(press, table) if editable else None
        marks = Overlay(
            markers=done,
            circles=() if handle is None else (handle,),
            lines=(rim, *ball_contour(press, table)),
        )
        good = tr("Ball found: contact radius {c:.2f} mm, pressed in by {d:.2f} mm.")
        text = good.format(c=press.contact_radius_mm, d=press.pose.depth_mm)
        return judged(marks, press.quality.figures, text, press)

    return or_refusal(look, marks=Overlay(markers=done, lines=(rim,)))


def _refuse_size(rgb: Rgb, size: tuple[int, int]) -> None:
    if (rgb.shape[1], rgb.shape[0]) != size:
        raise InputError(
            tr("the frame is {a} x {b} pixels, the earlier stages' are {c} x {d}").format(
                a=rgb.shape[1], b=rgb.shape[0], c=size[0], d=size[1]
            ),
            where=tr("frame"),
            advice=tr("Set the camera to the size of the earlier stages"),
        )
