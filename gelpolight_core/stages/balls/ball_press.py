"""A ball press found in an image, with a refined centre, and the place of the next press."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array, PointXY
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.geometry.drape import ball_depth_from_contact
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.geometry.resampling import ResamplingTable

from .ball_detection import find_indentation
from .ball_geometry import BallPose, ShadedPixels, refine_centre
from .contact_contour import ImageCircle
from .indentation import Indentation, indentation_at

INSIDE = 0.9
LEAST_VALUE = 0.02
GAIN_NOISE = 0.02
VALUE_NOISE = 0.003
COARSER = 8
"""Nodes between those at which a place for the next press is tested."""


@dataclass(frozen=True, slots=True)
class BallPress:
    """A press of a ball of known radius, found in its image.

    Attributes
    ----------
    name : str
        The image's file.
    pose : BallPose
        Centre, radius and depth, sensor frame.
    contact_radius_mm : float
        Radius of the contact.
    centre_sd_mm : float
        Standard deviation of the centre from the shading's misfit.
    shading_misfit : float
        Robust relative misfit of the shading inside the contact.
    indentation : Indentation
        What was found in the image before the refinement, in grid nodes, for an overlay.
    quality : QualityTable
        Figures, limits and advice.
    """

    name: str
    pose: BallPose
    contact_radius_mm: float
    centre_sd_mm: float
    shading_misfit: float
    indentation: Indentation
    quality: QualityTable

    def seen_centre_mm(self, ray_slope: Float64Array) -> Float64Array:
        """Return the position of the contact's centre as seen on the undeformed top surface, (2,).

        The rays meet the contact ring below the surface and nearer to the middle, by `ray_slope`
        per mm.
        """
        sagitta = self.pose.radius_mm - self._to_ring
        centre: Float64Array = np.asarray(self.pose.centre_mm, np.float64)
        return centre - float(self.pose.depth_mm - sagitta) * ray_slope

    def lean_mm(self, surface: MembraneShape) -> Float64Array:
        """Return the offset (2,) of the contact's middle from the ball's on a sloping membrane."""
        return contact_offset_mm(surface, np.asarray(self.pose.centre_mm), self._to_ring)

    @property
    def _to_ring(self) -> float:
        """Distance in mm from the ball's middle to the plane of the contact's edge."""
        return float(np.sqrt(self.pose.radius_mm**2 - self.contact_radius_mm**2))


def contact_offset_mm(
    surface: MembraneShape, centre_mm: Float64Array, to_ring_mm: float
) -> Float64Array:
    """Return the offset (2,) of a contact's middle from the ball's, towards the higher membrane.

    Parameters
    ----------
    surface : MembraneShape
        The undeformed membrane.
    centre_mm : (2,)
        Centre of the ball.
    to_ring_mm : float
        Distance from the ball's middle to the plane of the contact's edge.
    """
    return np.asarray(to_ring_mm * surface.normals(centre_mm)[:2])


@dataclass(frozen=True, slots=True)
class PlacedContact:
    """A contact placed by the user, where it is seen on the undeformed top surface.

    Attributes
    ----------
    centre_mm : tuple of 2 floats
        Centre, sensor frame.
    radius_mm : float
        Radius of the contact's edge.
    """

    centre_mm: tuple[float, float]
    radius_mm: float


def find_ball(
    image: Float32Array,
    background: Float32Array,
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    *,
    radius_mm: float,
    name: str,
    usable: BoolArray | None = None,
    placed: PlacedContact | None = None,
) -> BallPress:
    """Find a pressed ball in an image and refine its centre.

    Parameters
    ----------
    image, background : (rows, columns, 3) float32
        With and without the ball, resampled onto the grid, crosstalk removed.
    table : ResamplingTable
        The grid and its rays.
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    radius_mm : float
        Radius of the ball.
    name : str
        The image's file, for messages.
    usable : (rows, columns) bool, optional
        Nodes with light; by default all visible ones.
    placed : PlacedContact, optional
        The contact placed by the user; by default it is detected. Its centre is refined
        on the shading either way.

    Raises
    ------
    InputError
        If no single round indentation is found, its contact is larger than the ball, or none of
        its pixels has light.
    """
    usable = table.valid if usable is None else usable & table.valid
    if placed is None:
        indentation = find_indentation(image, background, valid=table.valid, name=name)
    else:
        x, y = table.grid.to_index(np.asarray(placed.centre_mm))
        circle = ImageCircle(float(x), float(y), placed.radius_mm / table.grid.pitch_mm)
        indentation = indentation_at(image, background, circle, valid=table.valid, name=name)
    pitch = table.grid.pitch_mm
    origin = np.array([table.grid.x_mm[0], table.grid.y_mm[0]])
    seen_mm = origin + pitch * np.asarray(indentation.centre)
    contact = pitch * indentation.contact_radius_px
    if contact >= radius_mm:
        raise contact_too_large(contact, radius_mm, name)
    depth = ball_depth_from_contact(contact, radius_mm)
    ray_slope, to_ring = _ray_slope_at(table, seen_mm), float(np.sqrt(radius_mm**2 - contact**2))
    ring = depth - (radius_mm - to_ring)
    centre = seen_mm + ring * ray_slope
    centre = centre - contact_offset_mm(table.surface, centre, to_ring)
    start = BallPose((float(centre[0]), float(centre[1])), radius_mm, depth)
    inside = usable & _within(table, seen_mm, INSIDE * contact)
    pixels = _shaded_pixels(image, background, table, inside)
    if not pixels.weight.any():
        raise InputError("no lit pixel of the contact can be used", name, Remedy.CHECK_EXPOSURE)
    pose, misfit, sd = refine_centre(pixels, start, led_positions_mm, table.surface)
    moved = float(np.hypot(*(np.array(pose.centre_mm) - centre)))
    quality = QualityTable(_judge(indentation, contact, radius_mm, moved, misfit))
    return BallPress(name, pose, contact, sd, misfit, indentation, quality)


def contact_too_large(contact_mm: float, radius_mm: float, name: str) -> InputError:
    """Return the error that a contact is larger than the ball that is stated."""
    text = "the contact is {c:.2f} mm wide, the ball's diameter is stated as {d:.2f} mm"
    text = text.format(c=2.0 * contact_mm, d=2.0 * radius_mm)
    return InputError(text, name, Remedy.CHECK_RADIUS)


def _within(table: ResamplingTable, centre_mm: Float64Array, radius_mm: float) -> BoolArray:
    x = table.grid.x_mm[None, :] - centre_mm[0]
    y = table.grid.y_mm[:, None] - centre_mm[1]
    return np.asarray(x**2 + y**2 < radius_mm**2)


def contact_mask(press: BallPress, table: ResamplingTable) -> BoolArray:
    """Return the nodes (rows, columns) well inside the contact, where the ball's shape is known."""
    ball_mm = np.asarray(press.pose.centre_mm)
    seen_mm = press.seen_centre_mm(_ray_slope_at(table, ball_mm)) + press.lean_mm(table.surface)
    return table.valid & _within(table, seen_mm, INSIDE * press.contact_radius_mm)


def _ray_slope_at(table: ResamplingTable, point_mm: Float64Array) -> Float64Array:
    column, row = np.round(table.grid.to_index(point_mm)).astype(int)
    rows, columns = table.grid.shape
    return np.asarray(
        table.ray_slope[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)], np.float64
    )


def _shaded_pixels(
    image: Float32Array, background: Float32Array, table: ResamplingTable, inside: BoolArray
) -> ShadedPixels:
    """Gather press over background inside the contact, evenly thinned, with weights."""
    rows, columns = np.nonzero(inside)
    # At most about 3000 pixels.
    stride = max(rows.size // 3_000, 1)
    rows, columns = rows[::stride], columns[::stride]
    value = image[rows, columns].astype(np.float64)
    reference = background[rows, columns].astype(np.float64)
    valid = (value > LEAST_VALUE) & (value < SATURATED) & (reference > LEAST_VALUE)
    # Noise of the ratio: a few per cent of the model, and the noise of the image over the
    # background.
    divisor = np.maximum(reference, LEAST_VALUE)
    weight = np.where(valid, 1.0 / (GAIN_NOISE + VALUE_NOISE / divisor), 0.0)
    points = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    ray_slope = table.ray_slope[rows, columns].astype(np.float64)
    return ShadedPixels(points, ray_slope, value / divisor, weight)


def _judge(
    indentation: Indentation, contact_mm: float, radius_mm: float, moved_mm: float, misfit: float
) -> tuple[Finding, ...]:
    return (
        *indentation.quality.figures,
        judge(
            "contact_radius_mm",
            "Contact radius",
            contact_mm,
            "mm",
            warn=0.9 * radius_mm,
            remedy="The ball is pressed in very deep: press less, or use a larger ball",
        ),
        judge(
            "centre_moved_mm",
            "Centre moved by the shading",
            moved_mm,
            "mm",
            warn=0.15 * contact_mm,
            fail=0.4 * contact_mm,
            remedy="Outline and shading disagree: look for dirt, or press again",
        ),
        judge(
            "shading_misfit_percent",
            "Shading not explained by the ball",
            100.0 * misfit,
            "%",
            warn=8.0,
            fail=25.0,
            remedy="Check the ball's diameter and that nothing else touches the membrane",
        ),
    )


def next_press_mm(
    table: ResamplingTable, radius_mm: float, earlier_mm: Sequence[PointXY]
) -> PointXY | None:
    """Return the position (x, y) in the working area that is farthest from all earlier presses.

    The first press is in the middle. It is always far enough from the border for the contact of the
    ball. None if the ball is too large for the field.
    """
    pitch_mm = COARSER * table.grid.pitch_mm
    valid = np.pad(table.valid[::COARSER, ::COARSER].astype(np.uint8), 1)
    inside_mm = pitch_mm * cv2.distanceTransform(valid, cv2.DIST_L2, 5)[1:-1, 1:-1]
    points = table.grid.points_mm()[::COARSER, ::COARSER]
    # A ball pressed in by half its radius has a contact of 0.87 of its radius.
    fits = inside_mm > 0.87 * radius_mm
    if not fits.any():
        return None
    distance_mm = inside_mm.astype(np.float64)
    if earlier_mm:
        offset_mm = points[:, :, None] - np.array(earlier_mm, np.float64)
        distance_mm = np.linalg.norm(offset_mm, axis=-1).min(axis=-1)
    best = np.unravel_index(np.argmax(np.where(fits, distance_mm, -1.0)), fits.shape)
    x_mm, y_mm = points[best]
    return float(x_mm), float(y_mm)
