"""Find the indentation of a ball in an image automatically.

Four steps. None of them needs the lights, the camera or the scale; all lengths are in pixels of the
given image, raw or resampled. (1) Markers printed on the membrane are found in the background and
filled. (2) The noise-scaled difference to the background gives the region. (3) The shading of a
ball, fitted to the whole region, gives a circle that is robust against texture and shadows. (4) The
kink of the shading at the contact's edge gives the exact circle if it is sharp and agrees with the
shading. Otherwise the circle of the shading is used, with its larger uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.scaled_difference import (
    ScaledDifference,
    check_gain,
    fill_holes_of_pair,
    mean_relative_change,
    scale_difference,
)

from .ball_shading import BALL_EXPLAINED, ShadingFit, fit_shading
from .contact_contour import ContactContour, ImageCircle, dilution, distance_in_radii, fit_edge
from .indentation import Indentation, describe_indentation
from .indentation_checks import (
    DETECTION,
    MOST_HIDDEN,
    SMALLEST_RADIUS_PX,
    BallRefusal,
    BallRefusalReason,
    check_light_change,
    check_order,
    check_round,
    check_shading,
    check_visible,
    check_whole,
    looks_like_ball,
    other_regions,
    reaches_border,
    share_in_view,
    unfitted,
)
from .markers import Markers, find_markers, inpaint

# The points of a clean edge scatter by 1 to 3 % of its radius. With texture, shadows and markers
# they scatter more, and the strongest kink may not be the edge.
_CLEAN_EDGE = 0.04
_AGREES = 0.12
# Systematic errors of the two circles. Their distance is the best measure of both: on rendered
# sensors 0.01 of the radius or less, on textured gels 0.04, with shadows 0.15.
_APART_OF_EDGE, _RESIDUAL_OF_EDGE = 0.7, 0.7
_MODEL_OF_SHADING, _APART_OF_SHADING = 0.09, 0.35


@dataclass(frozen=True, slots=True)
class BallDetection:
    """Result of the search for a ball's indentation in an image.

    Attributes
    ----------
    indentation : Indentation or None
        The indentation; None if the image shows no ball that can be used.
    reason : BallRefusalReason
        Why the image is refused: ``OK`` for a whole ball; ``CUT`` together with an indentation, if
        the visible part is that of a ball.
    refusal : InputError or None
        The reason as a sentence with its advice; None for a whole ball.
    """

    indentation: Indentation | None
    reason: BallRefusalReason
    refusal: InputError | None


def detect_ball(
    image: Float32Array,
    background: Float32Array,
    *,
    markers: Markers | None = None,
    ball_radius_px: float | None = None,
    valid: BoolArray | None = None,
    name: str = "press",
) -> BallDetection:
    """Find the one ball indentation in an image, or the reason why there is none.

    The step "Contour -> centre o1 and radius r of the contact" before Eq. (8) of the paper. Never
    raises for what an image shows.

    Parameters
    ----------
    image, background : (rows, columns, 3) float
        Image with the ball and image without contact, RGB, 0..1; pixels that are not finite
        are left out.
    markers : Markers, optional
        The membrane's markers, if they are known; by default they are detected in `background`.
    ball_radius_px : float, optional
        Radius of the ball over the pixel's size, if both are known; a contact cannot be larger.
    valid : (rows, columns) bool, optional
        The working area; without it, the lit part of `background`.
    name : str, optional
        Name of `image` in messages, such as its file.
    """
    try:
        image, background, area = fill_holes_of_pair(image, background, valid, name=name)
        markers = find_markers(background, area) if markers is None else markers
        indentation, cut = _detect(image, background, area, markers, ball_radius_px, name)
    except InputError as error:
        reason = (
            error.reason if isinstance(error, BallRefusal) else BallRefusalReason.UNUSABLE_IMAGE
        )
        return BallDetection(None, reason, error)
    return BallDetection(
        indentation, BallRefusalReason.OK if cut is None else BallRefusalReason.CUT, cut
    )


def find_indentation(
    press: Float32Array,
    background: Float32Array,
    *,
    markers: Markers | None = None,
    valid: BoolArray | None = None,
    ball_radius_px: float | None = None,
    cut: bool = False,
    name: str = "press",
) -> Indentation:
    """Find the one ball indentation in an image, or refuse the image.

    Parameters
    ----------
    press, background, markers, valid, ball_radius_px, name
        As in :func:`detect_ball`.
    cut : bool, optional
        Whether the border may cut it.

    Raises
    ------
    InputError
        If the images differ in size, are black or saturated; if the light changed between them
        or they are swapped; if there is no indentation, more than one, one that is cut by the
        border although it may not be, or one that is not that of a ball.
    """
    detection = detect_ball(
        press,
        background,
        markers=markers,
        valid=valid,
        ball_radius_px=ball_radius_px,
        name=name,
    )
    indentation = detection.indentation
    if detection.refusal is not None and not (cut and indentation):
        raise detection.refusal
    assert indentation is not None
    return indentation


def _detect(
    image: Float32Array,
    background: Float32Array,
    area: BoolArray,
    markers: Markers,
    ball_radius_px: float | None,
    name: str,
) -> tuple[Indentation, BallRefusal | None]:
    covered = markers.covered(image) & area
    image, background = inpaint(image, covered), inpaint(background, covered)
    change = scale_difference(image, background, area)
    check_gain(change.gain, name)
    region, start = _locate(change, name)
    shading = _fit_shading(change, covered, start, ball_radius_px)
    inside = distance_in_radii(area.shape, start if shading is None else shading.circle) < 1.0
    hidden = float(covered[inside].mean()) if inside.any() else 0.0
    if shading is None or hidden > MOST_HIDDEN:
        raise unfitted(hidden, name)
    # The difference in units of its noise.
    weights = np.diag(1.0 / np.array(change.noise, np.float32))
    blurred = cv2.GaussianBlur(change.difference, (0, 0), 0.8)
    edges = np.asarray(cv2.transform(blurred, weights), dtype=np.float32)
    contour, source = _edge(edges, area, shading, hidden)
    circle = contour.circle
    check_visible(circle, area, name)
    outside = area & (distance_in_radii(area.shape, circle) > 2.0)
    light_change = mean_relative_change(change, background, outside)
    check_light_change(light_change, name)
    _check_one(change, area, covered, shading, name)
    if source == "edge":
        check_round(contour, name)
    check_shading(shading, circle, ball_radius_px, hidden, name)
    check_order(image, background, area, circle, name)
    reaches = reaches_border(region, change.valid_small)
    indentation = describe_indentation(image, change, contour, light_change)
    try:
        check_whole(contour, area, reaches and source == "edge", name)
    except BallRefusal as cut:
        return indentation, cut
    return indentation, None


def _fit_shading(
    change: ScaledDifference, covered: BoolArray, start: ImageCircle, ball_radius_px: float | None
) -> ShadingFit | None:
    """Fit the ball's shading on the coarse grid, and return it in pixels of the image."""
    f = change.factor
    half = 0.5 * (f - 1)
    rows, columns = change.valid_small.shape
    usable = change.valid_small
    if covered.any():
        hidden_share = cv2.resize(
            covered[: rows * f, : columns * f].astype(np.float32),
            (columns, rows),
            interpolation=cv2.INTER_AREA,
        )
        usable = usable & (hidden_share < 0.5)
    start_small = ImageCircle((start.x - half) / f, (start.y - half) / f, start.radius / f)
    # The fit includes the steep beginning of the drape, so the circle can be a little too large.
    largest = np.inf if ball_radius_px is None else 1.2 * ball_radius_px / f
    noise = change.relative_noise
    fit = fit_shading(change.relative, usable, start_small, noise=noise, largest_px=largest)
    if fit is None:
        return None
    circle = ImageCircle(fit.circle.x * f + half, fit.circle.y * f + half, fit.circle.radius * f)
    return replace(fit, circle=circle, centre_sd_px=fit.centre_sd_px * f)


def _check_one(
    change: ScaledDifference, area: BoolArray, covered: BoolArray, first: ShadingFit, name: str
) -> None:
    """Refuse an image in which another disturbance has the shading of the same kind of object."""
    circle = first.circle
    if first.explained < BALL_EXPLAINED:
        return
    f, half = change.factor, 0.5 * (change.factor - 1)
    for region in other_regions(change, circle):
        start = _core_circle(change, region)
        rows, columns = np.indices(region.shape)
        distance = np.hypot(columns * f + half - circle.x, rows * f + half - circle.y)
        rest = replace(change, valid_small=change.valid_small & (distance > 1.5 * circle.radius))
        other_fit = _fit_shading(rest, covered, start, None)
        if other_fit is None or other_fit.explained < BALL_EXPLAINED:
            continue
        apart_px = np.hypot(other_fit.circle.x - circle.x, other_fit.circle.y - circle.y)
        separate = apart_px > circle.radius + 0.5 * other_fit.circle.radius
        alike = looks_like_ball(first) == looks_like_ball(other_fit)
        if separate and alike and share_in_view(other_fit.circle, area) > 0.5:
            raise BallRefusal(BallRefusalReason.SEVERAL, "there is more than one indentation", name)


def _edge(
    edges: Float32Array, area: BoolArray, shading: ShadingFit, hidden: float
) -> tuple[ContactContour, str]:
    """Return the kink's contour if it is clean and agrees with the shading, else the shading's."""
    expected, radius = shading.circle, shading.circle.radius
    contour = fit_edge(edges, area, expected)
    stretches = (*contour.stretches, shading.stretch)
    apart_px = float(np.hypot(contour.circle.x - expected.x, contour.circle.y - expected.y))
    clean = contour.residual_px < _CLEAN_EDGE * contour.circle.radius
    # Filled areas are smooth, so that their kink can be anywhere.
    clean &= hidden < 0.1
    if clean and apart_px < _AGREES * radius and 0.75 < contour.circle.radius / radius < 1.33:
        scatter_px = contour.residual_px * dilution(contour.points, contour.circle)
        systematic = np.hypot(_APART_OF_EDGE * apart_px, _RESIDUAL_OF_EDGE * scatter_px)
        sd = float(np.hypot(contour.centre_sd_px, systematic))
        return replace(contour, centre_sd_px=sd, stretches=stretches), "edge"
    angles_rad = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    x = expected.x + radius * np.cos(angles_rad)
    y = expected.y + radius * np.sin(angles_rad)
    rows, columns = area.shape
    inside = (x > -0.5) & (x < columns - 0.5) & (y > -0.5) & (y < rows - 0.5)
    visible = inside.copy()
    visible[inside] = area[np.rint(y[inside]).astype(int), np.rint(x[inside]).astype(int)]
    points = np.stack([x, y], axis=1)[visible]
    model_sd = np.hypot(_MODEL_OF_SHADING * radius, _APART_OF_SHADING * min(apart_px, 0.5 * radius))
    sd = float(np.hypot(shading.centre_sd_px, model_sd * dilution(points, expected)))
    coverage = float(visible.mean())
    return ContactContour(
        expected, points, sd, shading.axis_ratio, coverage, sd, stretches
    ), "shading"


def _locate(change: ScaledDifference, name: str) -> tuple[BoolArray, ImageCircle]:
    """Return the most disturbed region on the coarse grid, and a first circle about its core."""
    hot = (change.scaled > DETECTION).astype(np.uint8)
    opened = cv2.morphologyEx(hot, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels = cv2.connectedComponents(opened)
    weight = np.bincount(labels.ravel(), change.scaled.ravel(), minlength=count)
    weight[0] = 0.0
    region = labels == int(weight.argmax())
    smallest = np.pi * (SMALLEST_RADIUS_PX / change.factor) ** 2
    if count < 2 or np.count_nonzero(region) < smallest:
        text = "there is no indentation; nothing differs from the background beyond its noise"
        raise BallRefusal(BallRefusalReason.NO_INDENTATION, text, name, Remedy.PRESS_DEEPER)
    return region, _core_circle(change, region)


def _core_circle(change: ScaledDifference, region: BoolArray) -> ImageCircle:
    """Return a circle about the strongest part of a region, without drape and shadow.

    A ball is visible as a ring, often with gaps: gaps are closed, and the hull is used.
    """
    peak = float(np.quantile(change.scaled[region], 0.98))
    core = (region & (change.scaled > max(DETECTION, 0.4 * peak))).astype(np.uint8)
    gap = round(0.25 * float(np.sqrt(np.count_nonzero(core) / np.pi)))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * gap + 1, 2 * gap + 1))
    count, labels = cv2.connectedComponents(cv2.morphologyEx(core, cv2.MORPH_CLOSE, disc))
    largest_label = 1 + int(np.bincount(labels.ravel(), minlength=count)[1:].argmax())
    rows, columns = np.nonzero(labels == largest_label)
    (x, y), radius = cv2.minEnclosingCircle(np.stack([columns, rows], axis=1).astype(np.int32))
    hull = cv2.convexHull(np.stack([columns, rows], axis=1).astype(np.int32))
    moments = cv2.moments(hull)
    if moments["m00"] > 0.0:
        x, y = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
        radius = float(np.sqrt(moments["m00"] / np.pi))
    f, half = change.factor, 0.5 * (change.factor - 1)
    return ImageCircle(x * f + half, y * f + half, max(radius, 1.0) * f)
