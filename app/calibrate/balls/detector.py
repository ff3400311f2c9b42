"""Find a pressed ball in an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, as_image, judged, or_refusal
from app.calibrate.marks import ball_contour, ball_handle, working_circle
from app.live.image_checks import Rgb
from app.live.overlay import Circle, Marker, Overlay
from gelpolight_core.errors import InputError
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.optics.raw_positions import seen_at
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import find_ball
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# Radius of the contact circle drawn when no contact was found; the user moves it into position.
FIRST_RADIUS = 0.1
# A ball pressed in by half its radius has a contact of this radius.
CONTACT_OF_RADIUS = 0.87
COARSER = 8


@dataclass(frozen=True, slots=True)
class BallSetting:
    """Results of the earlier stages that the ball detection needs.

    Attributes
    ----------
    table : ResamplingTable
        Computed from lens, top pose and layers.
    led_positions_mm : (3, 3)
        Sensor frame.
    crosstalk : (3, 3)
        Result of the mirror stage.
    background : (rows, columns, 3) float32
        The bare membrane, resampled onto the table's grid, crosstalk removed.
    image_size : (width, height)
        Size of the frames in pixels.
    """

    table: ResamplingTable
    led_positions_mm: Array
    crosstalk: Array
    background: NDArray[np.float32]
    image_size: tuple[int, int]


def detect_ball(
    rgb: Rgb,
    setting: BallSetting,
    *,
    radius_mm: float,
    earlier_mm: Sequence[tuple[float, float]] = (),
    next_mm: tuple[float, float] | None = None,
    editable: bool = False,
) -> Detection:
    """Find a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    setting : BallSetting
        Results of the earlier stages.
    radius_mm : float
        Radius of the ball.
    earlier_mm : sequence of (x, y)
        Centres of the presses captured before, sensor frame.
    next_mm : (x, y), optional
        Where to press next, from :func:`next_press_mm`.
    editable : bool, optional
        Whether the contact circle can be dragged; its handle is ball.
    """
    table = setting.table
    done = tuple(Marker(u, v, "dot", "info") for u, v in _pixels(earlier_mm, table))
    there = () if next_mm is None else _pixels([next_mm], table)
    wanted = tuple(Marker(u, v, "ring", "expected", text=tr("next press")) for u, v in there)
    circle = working_circle(table)

    def detect() -> Detection:
        _refuse_size(rgb, setting.image_size)
        seen = unmix(table.apply(as_image(rgb).rgb), setting.crosstalk)
        press = find_ball(
            seen,
            setting.background,
            table,
            setting.led_positions_mm,
            radius_mm=radius_mm,
            name=tr("Image"),
        )
        handle = ball_handle(press, table) if editable else None
        marks = Overlay(
            markers=done,
            circles=() if handle is None else (handle,),
            lines=(circle, *ball_contour(press, table)),
        )
        good = tr("Ball found: contact radius {c:.2f} mm, depth {d:.2f} mm.")
        text = good.format(c=press.contact_radius_mm, d=press.pose.depth_mm)
        return judged(marks, press.quality.figures, text, press)

    return or_refusal(detect, marks=Overlay(markers=(*done, *wanted), lines=(circle,)))


def next_press_mm(
    table: ResamplingTable, radius_mm: float, earlier_mm: Sequence[tuple[float, float]]
) -> tuple[float, float] | None:
    """Return the position (x, y) in the working area that is farthest from all earlier presses.

    The first press is in the middle. It is always far enough from the border for the contact of the
    ball. None if the ball is too large for the field.
    """
    pitch_mm = COARSER * table.grid.pitch_mm
    valid = np.pad(table.valid[::COARSER, ::COARSER].astype(np.uint8), 1)
    inside_mm = pitch_mm * cv2.distanceTransform(valid, cv2.DIST_L2, 5)[1:-1, 1:-1]
    points = table.grid.points_mm()[::COARSER, ::COARSER]
    room = inside_mm > CONTACT_OF_RADIUS * radius_mm
    if not room.any():
        return None
    apart_mm = inside_mm.astype(np.float64)
    if earlier_mm:
        away = points[:, :, None] - np.array(earlier_mm, np.float64)
        apart_mm = np.linalg.norm(away, axis=-1).min(axis=-1)
    best = np.unravel_index(np.argmax(np.where(room, apart_mm, -1.0)), room.shape)
    x_mm, y_mm = points[best]
    return float(x_mm), float(y_mm)


def _pixels(
    points_mm: Sequence[tuple[float, float]], table: ResamplingTable
) -> list[tuple[float, float]]:
    """Return the pixels of points of the top surface; invisible points are left out."""
    nodes = table.grid.to_index(np.array(points_mm, np.float64).reshape(-1, 2))
    return [(float(u), float(v)) for u, v in seen_at(table, nodes)]


def _refuse_size(rgb: Rgb, size: tuple[int, int]) -> None:
    if (rgb.shape[1], rgb.shape[0]) != size:
        raise InputError(
            tr("the image has {a} x {b} pixels, but the earlier stages used {c} x {d}").format(
                a=rgb.shape[1], b=rgb.shape[0], c=size[0], d=size[1]
            ),
            where=tr("Image"),
            advice=tr("Set the camera to the image size of the earlier stages"),
        )


def placed_ball(circle: PlacedCircle, setting: BallSetting) -> Detection:
    """Show a contact that was placed by hand."""
    mark = Circle(circle.u_px, circle.v_px, circle.radius_px, "good", handle="ball")
    overlay = Overlay(circles=(mark,), lines=(working_circle(setting.table),))
    return Detection(overlay, tr("The contact was placed by hand."), True)


def ball_in_capture(rgb: Rgb, setting: BallSetting, radius_mm: float) -> Detection:
    """Find the ball in a capture; without one, offer a circle that the user can place."""
    found = detect_ball(rgb, setting, radius_mm=radius_mm, editable=True)
    return found if found.overlay.circles else with_first_circle(found, rgb)


def with_first_circle(found: Detection, rgb: Rgb) -> Detection:
    """Return a detection that found no contact, with a circle to drag onto it."""
    rows, columns = rgb.shape[:2]
    circle = Circle(columns / 2.0, rows / 2.0, FIRST_RADIUS * rows, "bad", handle="ball")
    marks = replace(found.overlay, circles=(circle,))
    by_hand = tr("Exclude the image, or drag the circle onto the edge of the contact.")
    return replace(found, overlay=marks, sentence=f"{found.sentence} {by_hand}")
