"""Detections of the stages: from figures, from errors, and their marks on the image."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.live.image_checks import Rgb, end_of_scale
from app.live.live_detection import Detection as Detection
from app.live.overlay import Circle, Line, Marker, Mask, Overlay, Role
from gelpolight_core.arrays import Array
from gelpolight_core.calibration.open_sensor import BACKGROUND, TOP_POSE
from gelpolight_core.calibration.recipe import Results
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.factors.bare_membrane import SHRINK
from gelpolight_core.finding import Finding, Verdict, refused, worst_of
from gelpolight_core.image.linear import LinearImage
from gelpolight_core.lights.mirror import MirrorSpots, Spot
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.checkerboard import BoardView
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.resampling import ResamplingTable, boundary_px, seen_at
from gelpolight_core.reflectance.indentation import Indentation
from gelpolight_core.session.images import read_raw_image, require_colour

Detector = Callable[[NDArray[Any]], Detection]
Mask2 = NDArray[np.bool_]


def too_early(_rgb: Rgb) -> Detection:
    """Detect nothing, because the results of earlier steps are missing."""
    text = "Complete the earlier steps first."
    return Detection(Overlay(), Finding("too_early", text, verdict=Verdict.FAIL))


def read_raw(path: Path) -> Rgb:
    """Return an image file unchanged, (rows, columns, 3) uint8 or uint16 RGB.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    return np.ascontiguousarray(read_raw_image(path).rgb)


def refuse_size(rgb: Rgb, size: tuple[int, int]) -> None:
    """Raise InputError if the frame does not have the (width, height) of earlier images."""
    rows, columns = rgb.shape[:2]
    if (columns, rows) != size:
        pixels, expected = f"{columns} x {rows} pixels", f"{size[0]} x {size[1]}"
        message = f"the image has {pixels}, but the earlier stages used {expected}"
        raise InputError(message, "Image", Remedy.SAME_CAMERA)


def as_image(rgb: Rgb, name: str = "") -> LinearImage:
    """Return a frame (rows, columns, 3) as a core LinearImage: float32, 0..1."""
    values = rgb.astype(np.float32) / np.float32(end_of_scale(rgb))
    return LinearImage(name, values, bit_depth=8 * rgb.dtype.itemsize)


def or_refusal(detect: Callable[[], Detection], *, marks: Overlay | None = None) -> Detection:
    """Return the result of `detect`, or the finding of its InputError with the given marks."""
    try:
        return detect()
    except InputError as error:
        return Detection(marks or Overlay(), refused(error))


def judged(overlay: Overlay, figures: tuple[Finding, ...], good: str) -> Detection:
    """Return a detection with its worst figure, or with the text `good` if all of them pass."""
    worst = worst_of(figures)
    return Detection(overlay, Finding("found", good) if worst is None else worst)


def share(mask: NDArray[np.bool_], area: NDArray[np.bool_]) -> float:
    """Return the share of `area` that is in `mask`, or 0 for an empty area."""
    count = int(np.count_nonzero(area))
    return float(np.count_nonzero(mask & area) / count) if count else 0.0


def beside(files: tuple[Path, ...], detect: Callable[[Rgb, Rgb | None], Detection]) -> Detector:
    """Return a detection that also gets the last image of another stage, or None.

    That image is read once, when it is first needed, in the processing thread.
    """

    @cache
    def other() -> Rgb | None:
        return read_raw(files[-1]) if files else None

    return lambda rgb: or_refusal(lambda: detect(rgb, other()))


def refuse_grey(rgb: Rgb) -> None:
    """Raise InputError if the image has no colours."""
    require_colour(as_image(rgb[::SHRINK, ::SHRINK]), where="Image")


def enlarged(mask: Mask2, rgb: Rgb) -> Mask2:
    """Return a mask of the shrunk image at the size of the image."""
    size = (rgb.shape[1], rgb.shape[0])
    return np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)) > 0


def marked(full: Mask2, suspect: Mask2) -> tuple[Mask, ...]:
    """Return the masks of saturated and suspect pixels that are not empty."""
    masks = (Mask(full, "bad"), Mask(suspect, "expected"))
    return tuple(mask for mask in masks if mask.area.any())


LED_ROLES: tuple[Role, Role, Role] = ("led0", "led1", "led2")


def board_outline(view: BoardView, role: Role) -> Line:
    """Return the line through the outermost inner corners."""
    columns, rows = view.board.inner_corners
    grid = view.corners_px.reshape(rows, columns, 2)
    return Line(
        np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]]),
        role,
        closed=True,
    )


def board_marks(view: BoardView) -> Overlay:
    """Return outline and corners of a board, with a ring that shows the first corner."""
    crosses = tuple(Marker(float(u), float(v), "plus", "good") for u, v in view.corners_px)
    u, v = view.corners_px[0]
    first = Marker(float(u), float(v), "ring", "info", text="1")
    return Overlay((*crosses, first), lines=(board_outline(view, "good"),))


def foot_point(camera: Camera, plane: TopPlane) -> Marker:
    """Return the pixel of the origin of the sensor frame, in air."""
    u, v = camera.project(plane.origin_camera_mm)
    return Marker(float(u), float(v), "ring", "info", text="origin")


def mirror_positions_px(camera: Camera, plane: TopPlane, led_positions_mm: Array) -> Array:
    """Return the pixels (3, 2) at which a mirror on the top surface would show the LEDs.

    Parameters
    ----------
    camera, plane
        Lens and pose of the top surface.
    led_positions_mm : (3, 3)
        Sensor frame, from a design or an earlier calibration.
    """
    mirrored = np.asarray(led_positions_mm) * np.array([1.0, 1.0, -1.0])
    return camera.project(plane.to_camera(mirrored))


def spot_markers(spots: MirrorSpots, *, editable: bool = False) -> tuple[Marker, ...]:
    """Return the three centroids and the rejected spots, with handles if `editable`."""
    centres = tuple(
        Marker(
            *spot.centre_px,
            kind="plus",
            role=LED_ROLES[k],
            text=CHANNEL_KEYS[k],
            handle=f"mirror.{k}" if editable else "",
        )
        for k, spot in enumerate(spots.spots)
    )
    glints = tuple(
        Marker(*spot.centre_px, kind="cross", role="bad", text="glint")
        for spot, _ in spots.rejected
    )
    return (*centres, *glints)


def spot_mask(rgb: NDArray[np.generic], spot: Spot, role: Role) -> Mask:
    """Return the pixels above half of a spot's peak, which form its area."""
    reach_px = 2 + math.ceil(2.0 * spot.elongation * math.sqrt(spot.area_px / math.pi))
    u, v = (round(c) for c in spot.centre_px)
    window = np.s_[max(v - reach_px, 0) : v + reach_px + 1, max(u - reach_px, 0) : u + reach_px + 1]
    brightness = rgb[window].sum(axis=2, dtype=np.float64)
    mask = np.zeros(rgb.shape[:2], np.bool_)
    mask[window] = brightness > 0.5 * brightness.max()
    return Mask(mask, role)


def working_circle(table: ResamplingTable) -> Line:
    """Return the border of the working area, in the raw image."""
    return Line(boundary_px(table), "info", closed=True)


def ball_contour(indentation: Indentation, table: ResamplingTable) -> tuple[Line, ...]:
    """Return the detected edge of the contact, and the circle fitted to it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    fitted_circle = np.asarray(indentation.centre) + indentation.contact_radius_px * ring
    return (
        Line(seen_at(table, indentation.contour), "expected", closed=True),
        Line(seen_at(table, fitted_circle), "good", closed=True),
    )


def ball_handle(indentation: Indentation, table: ResamplingTable) -> Circle | None:
    """Return the contact as a circle that the user can move, or None if it is not visible."""
    centre = np.asarray(indentation.centre)
    directions = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    centre_px = seen_at(table, centre[None])
    edge_px = seen_at(table, centre + indentation.contact_radius_px * directions)
    if len(centre_px) == 0 or len(edge_px) == 0:
        return None
    radius_px = float(np.mean(np.linalg.norm(edge_px - centre_px[0], axis=1)))
    return Circle(float(centre_px[0, 0]), float(centre_px[0, 1]), radius_px, "good", handle="ball")


def table_of(results: Results) -> ResamplingTable | None:
    """Return the table from image to membrane, or None if the top surface is not known."""
    top, bare = results.get(TOP_POSE), results.get(BACKGROUND)
    if top is None or bare is None or top.table.surface.flat:
        return None if top is None else top.table
    return bare.table  # the background shows the axis of a curved membrane
