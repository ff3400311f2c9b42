"""Check that a detected indentation shows one whole ball.

Clear cases are refused with the reason; the others become judged figures with the same limits.
"""

from __future__ import annotations

from enum import StrEnum

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.scaled_difference import BACKGROUND, ScaledDifference

from .ball_shading import BALL_EXPLAINED, ShadingFit
from .contact_contour import ContactContour, ImageCircle, kink_energy, kink_table

# Five standard deviations over three channels: one false pixel in about 60 000. Morphological
# opening removes single pixels.
DETECTION = 5.0
SMALLEST_RADIUS_PX = 6.0
# A circle at the boundary of the field has more than 0.95; two touching presses have less than
# 0.75.
_LEAST_AXIS_RATIO = 0.8
LEAST_COVERAGE = 0.35
# A shorter arc does not give an ellipse.
ROUND_FROM = 0.75
# From 0.3 contact radii off, the shading brings the centre back to 0.03, a slope of one degree;
# from 0.5 off, to 0.15. Two standard deviations are within it.
LARGEST_SD = 0.5 * 0.3
LARGEST_LIGHT_CHANGE = 0.1
# The inner half of a ball changes like the whole: 0.9 to 1.6 on all tested sensors. Flat faces give
# 0.2 or less, domed faces 0.5.
_LEAST_INNER_CHANGE = 0.7
_LEAST_VISIBLE = 0.4
# Behind markers the image is estimated: above the first limit no object can be recognised, above
# the second
# no ball can be denied.
MOST_HIDDEN = 0.7
_MUCH_HIDDEN = 0.45
# Shadows widen a contact; the camera's scale and the ball's radius are known to some per cent.
LARGEST_OF_BALL = 1.3


class BallRefusalReason(StrEnum):
    """Why an image shows no ball that can be used, for scripts and tests."""

    OK = "ok"
    CUT = "cut"
    NO_INDENTATION = "no_indentation"
    SEVERAL = "several"
    NOT_ROUND = "not_round"
    FLAT = "flat"
    NOT_A_BALL = "not_a_ball"
    TOO_SMALL = "too_small"
    TOO_LARGE = "too_large"
    MARKERS = "markers"
    LIGHT_CHANGED = "light_changed"
    SWAPPED = "swapped"
    UNUSABLE_IMAGE = "unusable_image"


class BallRefusal(InputError):
    """An image that shows no ball that can be used.

    Parameters
    ----------
    reason : BallRefusalReason
        Why, as a key.
    found, where, advice : str
        As for :class:`~gelpolight_core.base.errors.InputError`.
    """

    def __init__(
        self, reason: BallRefusalReason, found: str, where: str, advice: str = Remedy.ONE_BALL
    ) -> None:
        super().__init__(found, where=where, advice=advice)
        self.reason = reason


def reaches_border(region: BoolArray, valid: BoolArray) -> bool:
    """Return whether a region touches the border of the image or of the working area.

    Parameters
    ----------
    region, valid : (rows, columns) bool
        The disturbed region and the working area, on one grid.
    """
    framed = np.pad(valid, 1, constant_values=False).astype(np.uint8)
    inner = cv2.erode(framed, np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    return bool(np.any(region & ~inner))


def check_whole(contour: ContactContour, area: BoolArray, reaches: bool, name: str) -> None:
    """Refuse an indentation that the border cuts.

    Parameters
    ----------
    contour : ContactContour
        The contact's edge.
    area : (rows, columns) bool
        The working area.
    reaches : bool
        Whether the disturbed region touches the border.
    name : str
        The image's name.

    Raises
    ------
    InputError
        If any of the edge lies outside, or most of it was not seen and the
        region touches the border.
    """
    # A kink is visible only with some membrane outside it.
    outside = 1.0 - share_in_view(contour.circle, area, margin_px=1.0)
    if outside > 0.0:
        raise _cut(outside, name)
    if reaches and contour.coverage < LEAST_COVERAGE:
        raise _cut(1.0 - contour.coverage, name)


def _cut(share_outside: float, name: str) -> BallRefusal:
    """Return the refusal of an indentation that the border cuts."""
    text = (
        f"the border cuts the indentation; {100.0 * share_outside:.0f} % of its edge is out of view"
    )
    return BallRefusal(BallRefusalReason.CUT, text, name, Remedy.PRESS_MIDDLE)


def share_in_view(circle: ImageCircle, area: BoolArray, *, margin_px: float = 0.0) -> float:
    """Return the share of a circle, widened by `margin_px`, that lies in the working area."""
    angle = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    column = np.rint(circle.x + (circle.radius + margin_px) * np.cos(angle)).astype(np.intp)
    row = np.rint(circle.y + (circle.radius + margin_px) * np.sin(angle)).astype(np.intp)
    rows, columns = area.shape
    within = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    within &= area[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    return float(within.mean())


def check_visible(circle: ImageCircle, area: BoolArray, name: str) -> None:
    """Refuse an indentation with too small a visible part to find its centre.

    Parameters
    ----------
    circle : ImageCircle
        The contact's edge.
    area : (rows, columns) bool
        The working area.
    name : str
        The image's name.

    Raises
    ------
    InputError
        If less than two fifths of the edge is in view.
    """
    visible = share_in_view(circle, area)
    if visible < _LEAST_VISIBLE:
        raise _cut(1.0 - visible, name)


def looks_like_ball(shading: ShadingFit) -> bool:
    """Return whether a fitted shading belongs to a round, curved object."""
    return (
        shading.explained >= BALL_EXPLAINED
        and shading.inner_change >= _LEAST_INNER_CHANGE
        and shading.axis_ratio >= _LEAST_AXIS_RATIO
    )


def check_shading(
    shading: ShadingFit,
    circle: ImageCircle,
    ball_radius_px: float | None,
    hidden: float,
    name: str,
) -> None:
    """Refuse an indentation whose shading is not a ball's.

    Parameters
    ----------
    shading : ShadingFit
        The fit of a ball's shading.
    circle : ImageCircle
        The contact's edge.
    ball_radius_px : float or None
        Radius of the ball, if it is known.
    hidden : float
        Share of the contact that markers hide.
    name : str
        The image's name.

    Raises
    ------
    InputError
        If the shading is not that of a ball, the contact is too small or larger than the ball, or
        markers hide too much of it.
    """
    if circle.radius < SMALLEST_RADIUS_PX:
        text = f"the contact's radius is only {circle.radius:.1f} px, too small to use"
        raise BallRefusal(BallRefusalReason.TOO_SMALL, text, name)
    if not looks_like_ball(shading) and hidden > _MUCH_HIDDEN:
        raise _hidden(hidden, name)
    if shading.inner_change < _LEAST_INNER_CHANGE:
        raise BallRefusal(
            BallRefusalReason.FLAT, "the indentation is flat inside, unlike a ball's", name
        )
    if shading.axis_ratio < _LEAST_AXIS_RATIO:
        raise _oval(shading.axis_ratio, name)
    if shading.explained < BALL_EXPLAINED:
        share = 100.0 * max(shading.explained, 0.0)
        text = f"a ball's shading explains only {share:.0f} % of the change in the image"
        raise BallRefusal(BallRefusalReason.NOT_A_BALL, text, name)
    if ball_radius_px is not None and circle.radius > LARGEST_OF_BALL * ball_radius_px:
        wide, ball = 2.0 * circle.radius, 2.0 * ball_radius_px
        text = f"the contact is {wide:.0f} px wide, the ball only {ball:.0f} px"
        raise BallRefusal(BallRefusalReason.TOO_LARGE, text, name)


def unfitted(hidden: float, name: str) -> BallRefusal:
    """Return the refusal of a disturbance with too few pixels for a fit."""
    if hidden > 0.3:
        return _hidden(hidden, name)
    return BallRefusal(
        BallRefusalReason.TOO_SMALL, "the changed area is too small for a ball", name
    )


def _hidden(hidden: float, name: str) -> BallRefusal:
    text = f"printed markers hide {100.0 * hidden:.0f} % of the contact"
    return BallRefusal(BallRefusalReason.MARKERS, text, name)


def other_regions(change: ScaledDifference, circle: ImageCircle) -> list[BoolArray]:
    """Return the disturbances that are about as strong and as large as a contact.

    Parameters
    ----------
    change : ScaledDifference
        Difference of the two images.
    circle : ImageCircle
        The contact's edge.

    Returns
    -------
    list of (small rows, small columns) bool
        On the grid of `change`, the largest of each threshold; empty if there is only one contact.
    """
    f, half = change.factor, 0.5 * (change.factor - 1)
    rows, columns = np.indices(change.scaled.shape)
    distance = np.hypot(columns * f + half - circle.x, rows * f + half - circle.y) / circle.radius
    inside = change.scaled[distance < 1.0]
    if len(inside) == 0:
        return []
    peak = float(np.quantile(inside, 0.9))
    min_area = np.pi * max(0.4 * circle.radius, SMALLEST_RADIUS_PX) ** 2 / f**2
    regions = []
    for share in (0.35, 0.5, 0.7):
        # Drape and shadow of the first contact are connected with it; another press is not.
        hot = (change.scaled > max(DETECTION, share * peak)) | (distance < 1.3)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(hot.astype(np.uint8))
        areas = stats[:, cv2.CC_STAT_AREA].copy()
        areas[[0, labels[distance < 1.3][0]]] = 0
        if areas.max() > min_area:
            regions.append(np.asarray(labels == int(areas.argmax())))
    return regions


def check_round(contour: ContactContour, name: str) -> None:
    """Refuse an edge that no ball has.

    Parameters
    ----------
    contour : ContactContour
        The contact's edge.
    name : str
        The image's name.

    Raises
    ------
    InputError
        If it was seen in too few directions, or is oval.
    """
    if contour.coverage < LEAST_COVERAGE:
        raise BallRefusal(BallRefusalReason.NOT_ROUND, "no round contact edge was found", name)
    if contour.coverage > ROUND_FROM and contour.axis_ratio < _LEAST_AXIS_RATIO:
        raise _oval(contour.axis_ratio, name)


def _oval(axis_ratio: float, name: str) -> BallRefusal:
    ratio = 1.0 / max(axis_ratio, 0.01)
    text = f"the indentation is not round; its axis ratio is 1 to {ratio:.2f}"
    return BallRefusal(BallRefusalReason.NOT_ROUND, text, name)


def check_order(
    press: Float32Array, background: Float32Array, area: BoolArray, circle: ImageCircle, name: str
) -> None:
    """Refuse the images when the kink lies in the background.

    Parameters
    ----------
    press, background : (rows, columns, 3) float32
        The images.
    area : (rows, columns) bool
        The working area.
    circle : ImageCircle
        The contact's edge.
    name : str
        Name of `press`.

    Raises
    ------
    InputError
        If the images seem to be swapped.
    """
    tables = [kink_table(p, area, circle, half_width=0.25) for p in (press, background)]
    before, after = (kink_energy(table, circle.radius) for table in reversed(tables))
    # Texture and noise are the same in both images, so a small difference proves nothing.
    if before > 4.0 * after:
        text = "the indentation is in the background, not in the press"
        raise BallRefusal(
            BallRefusalReason.SWAPPED, text, f"{name}, {BACKGROUND}", Remedy.SWAP_IMAGES
        )


def check_light_change(light_change: float, name: str) -> None:
    """Refuse images between which the light changed.

    Parameters
    ----------
    light_change : float
        Relative change far from the contact.
    name : str
        The image's name.

    Raises
    ------
    InputError
        If it is more than a tenth.
    """
    if light_change > LARGEST_LIGHT_CHANGE:
        text = f"the light changed by {100.0 * light_change:.0f} % far from the contact"
        raise BallRefusal(BallRefusalReason.LIGHT_CHANGED, text, name, Remedy.SAME_LIGHT)
