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

from app.live.image_checks import end_of_scale
from app.live.live_detection import Detection as Detection
from app.live.overlay import (
    ImageOverlay,
    OverlayCircle,
    OverlayLine,
    OverlayMarker,
    OverlayMask,
    Role,
)
from gelpolight_core.base.arrays import BoolArray, Float64Array, PixelArray
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, Verdict, finding_from_error, worst_of
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND, TOP_POSE
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import ResamplingTable, boundary_px, node_pixels
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.session_images import read_raw_image, require_colour
from gelpolight_core.stages.balls.indentation import Indentation
from gelpolight_core.stages.checkerboards.checkerboard import BoardView
from gelpolight_core.stages.flat_field.bare_membrane_check import SHRINK
from gelpolight_core.stages.leds.mirror_spots import MirrorSpot, MirrorSpots

Detector = Callable[[NDArray[Any]], Detection]


def detect_nothing(_rgb: PixelArray) -> Detection:
    """Detect nothing, because the results of earlier steps are missing."""
    text = "Complete the earlier steps first."
    return Detection(ImageOverlay(), Finding("too_early", text, verdict=Verdict.FAIL))


def read_raw(path: Path) -> PixelArray:
    """Return an image file unchanged, (rows, columns, 3) uint8 or uint16 RGB.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    return np.ascontiguousarray(read_raw_image(path).rgb)


def refuse_size(rgb: PixelArray, size: tuple[int, int]) -> None:
    """Raise InputError if the frame does not have the (width, height) of earlier images."""
    rows, columns = rgb.shape[:2]
    if (columns, rows) != size:
        pixels, expected = f"{columns} x {rows} pixels", f"{size[0]} x {size[1]}"
        message = f"the image has {pixels}, but the earlier stages used {expected}"
        raise InputError(message, "Image", Remedy.SAME_CAMERA)


def as_image(rgb: PixelArray, name: str = "") -> LinearImage:
    """Return a frame (rows, columns, 3) as a core LinearImage: float32, 0..1."""
    values = rgb.astype(np.float32) / np.float32(end_of_scale(rgb))
    return LinearImage(name, values, bit_depth=8 * rgb.dtype.itemsize)


def detect_or_refusal(
    detect: Callable[[], Detection], *, marks: ImageOverlay | None = None
) -> Detection:
    """Return the result of `detect`, or the finding of its InputError with the given marks."""
    try:
        return detect()
    except InputError as error:
        return Detection(marks or ImageOverlay(), finding_from_error(error))


def judged_detection(overlay: ImageOverlay, figures: tuple[Finding, ...], good: str) -> Detection:
    """Return a detection with its worst figure, or with the text `good` if all of them pass."""
    worst = worst_of(figures)
    return Detection(overlay, Finding("found", good) if worst is None else worst)


def share_of_area(mask: NDArray[np.bool_], area: NDArray[np.bool_]) -> float:
    """Return the share of `area` that is in `mask`, or 0 for an empty area."""
    count = int(np.count_nonzero(area))
    return float(np.count_nonzero(mask & area) / count) if count else 0.0


def with_other_stage_image(
    files: tuple[Path, ...], detect: Callable[[PixelArray, PixelArray | None], Detection]
) -> Detector:
    """Return a detection that also gets the last image of another stage, or None.

    That image is read once, when it is first needed, in the processing thread.
    """

    @cache
    def other() -> PixelArray | None:
        return read_raw(files[-1]) if files else None

    return lambda rgb: detect_or_refusal(lambda: detect(rgb, other()))


def refuse_grey(rgb: PixelArray) -> None:
    """Raise InputError if the image has no colours."""
    require_colour(as_image(rgb[::SHRINK, ::SHRINK]), where="Image")


def to_image_size(mask: BoolArray, rgb: PixelArray) -> BoolArray:
    """Return a mask of the shrunk image at the size of the image."""
    size = (rgb.shape[1], rgb.shape[0])
    return np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)) > 0


def suspect_masks(full: BoolArray, suspect: BoolArray) -> tuple[OverlayMask, ...]:
    """Return the masks of saturated and suspect pixels that are not empty."""
    masks = (OverlayMask(full, "bad"), OverlayMask(suspect, "expected"))
    return tuple(mask for mask in masks if mask.area.any())


LED_ROLES: tuple[Role, Role, Role] = ("led0", "led1", "led2")


def board_outline(view: BoardView, role: Role) -> OverlayLine:
    """Return the line through the outermost inner corners."""
    columns, rows = view.board.inner_corners
    grid = view.corners_px.reshape(rows, columns, 2)
    return OverlayLine(
        np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]]),
        role,
        closed=True,
    )


def board_marks(view: BoardView) -> ImageOverlay:
    """Return outline and corners of a board, with a ring that shows the first corner."""
    crosses = tuple(OverlayMarker(float(u), float(v), "plus", "good") for u, v in view.corners_px)
    u, v = view.corners_px[0]
    first = OverlayMarker(float(u), float(v), "ring", "info", text="1")
    return ImageOverlay((*crosses, first), lines=(board_outline(view, "good"),))


def foot_point(camera: CameraModel, plane: TopPlane) -> OverlayMarker:
    """Return the pixel of the origin of the sensor frame, in air."""
    u, v = camera.project(plane.origin_camera_mm)
    return OverlayMarker(float(u), float(v), "ring", "info", text="origin")


def mirror_positions_px(
    camera: CameraModel, plane: TopPlane, led_positions_mm: Float64Array
) -> Float64Array:
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


def spot_markers(spots: MirrorSpots, *, editable: bool = False) -> tuple[OverlayMarker, ...]:
    """Return the three centroids and the rejected spots, with handles if `editable`."""
    centres = tuple(
        OverlayMarker(
            *spot.centre_px,
            kind="plus",
            role=LED_ROLES[k],
            text=CHANNEL_KEYS[k],
            handle=f"mirror.{k}" if editable else "",
        )
        for k, spot in enumerate(spots.spots)
    )
    glints = tuple(
        OverlayMarker(*spot.centre_px, kind="cross", role="bad", text="glint")
        for spot, _ in spots.rejected
    )
    return (*centres, *glints)


def spot_mask(rgb: NDArray[np.generic], spot: MirrorSpot, role: Role) -> OverlayMask:
    """Return the pixels above half of a spot's peak, which form its area."""
    reach_px = 2 + math.ceil(2.0 * spot.elongation * math.sqrt(spot.area_px / math.pi))
    u, v = (round(c) for c in spot.centre_px)
    window = np.s_[max(v - reach_px, 0) : v + reach_px + 1, max(u - reach_px, 0) : u + reach_px + 1]
    brightness = rgb[window].sum(axis=2, dtype=np.float64)
    mask = np.zeros(rgb.shape[:2], np.bool_)
    mask[window] = brightness > 0.5 * brightness.max()
    return OverlayMask(mask, role)


def working_circle(table: ResamplingTable) -> OverlayLine:
    """Return the border of the working area, in the raw image."""
    return OverlayLine(boundary_px(table), "info", closed=True)


def ball_contour(indentation: Indentation, table: ResamplingTable) -> tuple[OverlayLine, ...]:
    """Return the detected edge of the contact, and the circle fitted to it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    fitted_circle = np.asarray(indentation.centre) + indentation.contact_radius_px * ring
    return (
        OverlayLine(node_pixels(table, indentation.contour), "expected", closed=True),
        OverlayLine(node_pixels(table, fitted_circle), "good", closed=True),
    )


def ball_handle(indentation: Indentation, table: ResamplingTable) -> OverlayCircle | None:
    """Return the contact as a circle that the user can move, or None if it is not visible."""
    centre = np.asarray(indentation.centre)
    directions = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    centre_px = node_pixels(table, centre[None])
    edge_px = node_pixels(table, centre + indentation.contact_radius_px * directions)
    if len(centre_px) == 0 or len(edge_px) == 0:
        return None
    radius_px = float(np.mean(np.linalg.norm(edge_px - centre_px[0], axis=1)))
    u, v = map(float, centre_px[0])
    return OverlayCircle(u, v, radius_px, "good", handle="ball")


def table_of(results: StageResults) -> ResamplingTable | None:
    """Return the table from image to membrane, or None if the top surface is not known."""
    top, bare = results.get(TOP_POSE), results.get(BACKGROUND)
    if top is None or bare is None or top.table.surface.flat:
        return None if top is None else top.table
    return bare.table  # the background shows the axis of a curved membrane
