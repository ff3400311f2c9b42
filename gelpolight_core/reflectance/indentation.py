"""A ball's indentation, found in a picture by itself.

Noise-scaled difference to the picture without contact, then the kink of the shading at the
contact's edge, then a circle through it. No light, camera or scale need be known, so the pictures
may be raw or resampled; everything is in pixels of the picture given.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.quality import QualityTable
from gelpolight_core.reflectance.contour import Circle, Contour, distance_in_radii, fit_edge
from gelpolight_core.reflectance.indentation_checks import (
    DETECTION,
    SMALLEST_RADIUS_PX,
    check_ball,
    check_drift,
    check_one,
    check_order,
    check_round,
    check_whole,
    judge_indentation,
    reaches_border,
)
from gelpolight_core.reflectance.noise import (
    SATURATED,
    ScaledDifference,
    change_where,
    check_gain,
    prepare_pair,
    scale_difference,
)
from gelpolight_core.translation import tr

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

# A careful hand on a magnified picture.
PLACED_SD_PX = 0.5
LEAST_PLACED_INSIDE = 0.9
_BLUR_PX = 0.8
# What a Gaussian leaves of white noise of variance 1, in three channels.
_NOISE_LEFT = 3.0 / (4.0 * np.pi * _BLUR_PX**2)


@dataclass(frozen=True, slots=True)
class Indentation:
    """One ball's indentation in a picture.

    The circle is the picture of the contact's edge: where the membrane leaves the ball, marked by
    the kink of the shading and not by a threshold. Its centre is the picture of the edge's centre,
    which lies at the edge's depth; the ball's lowest point is deeper and is therefore seen a few
    pixels nearer to the picture's foot point where the view is oblique.

    Attributes
    ----------
    centre : tuple of 2 floats
        (x, y) in pixels, pixel centres at whole numbers.
    contact_radius_px : float
        Radius of the contact's edge.
    contour : (N, 2) float64
        (x, y) of the edge in every direction in which it was seen, pixels.
    residual_px : float
        Robust standard deviation of the contour about the circle.
    centre_sd_px : float
        Standard deviation of the centre that follows from it.
    axis_ratio : float
        Shorter over longer axis of the ellipse through the contour.
    coverage : float
        Share of the directions in which the edge was seen, 0..1.
    disturbed : (rows, columns) bool
        Where the picture differs from the background around the contact: contact, drape, shadow.
    noise : tuple of 3 floats
        Standard deviation of the difference of the two pictures per channel, 0..1.
    gain : tuple of 3 floats
        Brightness of the picture over the background's where nothing touches, per channel.
    signal_to_noise : float
        Root mean square difference inside the contact over the noise of one pixel.
    touches_border : bool
        Whether `disturbed` reaches the border of the picture or of the working area (the contact
        itself does not).
    quality : QualityTable
        The judged figures.
    """

    centre: tuple[float, float]
    contact_radius_px: float
    contour: NDArray[np.float64]
    residual_px: float
    centre_sd_px: float
    axis_ratio: float
    coverage: float
    disturbed: Mask
    noise: tuple[float, float, float]
    gain: tuple[float, float, float]
    signal_to_noise: float
    touches_border: bool
    quality: QualityTable

    @property
    def disturbed_area_px(self) -> int:
        """Number of disturbed pixels."""
        return int(np.count_nonzero(self.disturbed))


def find_indentation(
    press: Array,
    background: Array,
    *,
    valid: Mask | None = None,
    name: str = "press",
    background_name: str = "background",
) -> Indentation:
    """Find the one ball indentation in a picture.

    The step "Contour -> centre o1 and radius r of the contact" before Eq. (8) of the paper.

    Parameters
    ----------
    press, background : (rows, columns, 3) float
        Picture with the ball and picture without contact, RGB, 0..1; pixels that are not finite
        are left out.
    valid : (rows, columns) bool, optional
        The working area; without it, the lit part of `background`.
    name, background_name : str, optional
        What to call the pictures in messages, such as their files.

    Returns
    -------
    Indentation
        Circle, contour and quality.

    Raises
    ------
    InputError
        If the pictures differ in size, are black or saturated; if the light changed between them
        or they are swapped; if there is no indentation, more than one, one that is cut by the
        border, or one that is not a ball's.
    """
    press, background, area = prepare_pair(
        press, background, valid, name=name, background_name=background_name
    )
    change = scale_difference(press, background, area)
    check_gain(change.gain, name)
    region, start = _locate(change, name)
    sharp = _in_noise_units(change)
    contour = fit_edge(sharp, area, start)
    reaches = reaches_border(region, change.valid_small)
    check_whole(contour, area, reaches, name)
    far = area & (distance_in_radii(area.shape, contour.circle) > 2.0)
    drift = change_where(change, background, far)
    check_drift(drift, name)
    check_one(change, contour.circle, name)
    check_round(contour, name)
    check_ball(sharp, contour.circle, name, noise_variance=_NOISE_LEFT)
    check_order(press, background, area, contour.circle, name, background_name)
    return _result(press, change, contour, region, reaches, drift)


def indentation_at(
    press: Array,
    background: Array,
    circle: Circle,
    *,
    valid: Mask | None = None,
    name: str = "press",
    background_name: str = "background",
) -> Indentation:
    """Describe an indentation whose contact a person has placed.

    Parameters
    ----------
    press, background, valid, name, background_name
        As in :func:`find_indentation`.
    circle : Circle
        The contact's edge as placed, pixels.

    Returns
    -------
    Indentation
        With the placed circle as its contour and a centre that is as sure as a hand is.

    Raises
    ------
    InputError
        If the pictures cannot be compared, or the circle reaches beyond the working area.
    """
    press, background, area = prepare_pair(
        press, background, valid, name=name, background_name=background_name
    )
    change = scale_difference(press, background, area)
    within = distance_in_radii(area.shape, circle) < 1.0
    if not within.any() or np.count_nonzero(within & area) < LEAST_PLACED_INSIDE * np.pi * (
        circle.radius**2
    ):
        raise InputError(
            tr("the contact placed by hand reaches beyond the working area"),
            where=name,
            advice=tr("Move it inside, or leave this picture out"),
        )
    turns = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    points = np.stack(
        [circle.x + circle.radius * np.cos(turns), circle.y + circle.radius * np.sin(turns)], axis=1
    )
    contour = Contour(circle, points, 0.0, 1.0, 1.0, PLACED_SD_PX)
    region = np.asarray(change.scaled > DETECTION)
    far = area & (distance_in_radii(area.shape, circle) > 2.0)
    drift = change_where(change, background, far)
    reaches = reaches_border(region, change.valid_small)
    return _result(press, change, contour, region, reaches, drift)


def _in_noise_units(change: ScaledDifference) -> Array:
    weights = np.diag(1.0 / np.array(change.noise, np.float32))
    blurred = cv2.GaussianBlur(change.difference, (0, 0), _BLUR_PX)
    return np.asarray(cv2.transform(blurred, weights), dtype=np.float32)


def _locate(change: ScaledDifference, name: str) -> tuple[Mask, Circle]:
    """Return the most disturbed region on the coarse grid, and a first circle about its core."""
    hot = (change.scaled > DETECTION).astype(np.uint8)
    opened = cv2.morphologyEx(hot, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels = cv2.connectedComponents(opened)
    weight = np.bincount(labels.ravel(), change.scaled.ravel(), minlength=count)
    weight[0] = 0.0
    region = labels == int(weight.argmax())
    smallest = np.pi * (SMALLEST_RADIUS_PX / change.factor) ** 2
    if count < 2 or np.count_nonzero(region) < smallest:
        raise InputError(
            tr("there is no indentation; nothing differs from the background beyond its noise"),
            where=name,
            advice=tr("Press the ball deeper, or leave this picture out"),
        )
    return region, _core_circle(change, region)


def _core_circle(change: ScaledDifference, region: Mask) -> Circle:
    """Return a circle about the strongest part of a region; drape and shadow are fainter.

    A ball is seen as a ring, often a broken one: gaps are closed, and the hull taken.
    """
    top = float(np.quantile(change.scaled[region], 0.98))
    core = (region & (change.scaled > max(DETECTION, 0.4 * top))).astype(np.uint8)
    gap = round(0.25 * float(np.sqrt(np.count_nonzero(core) / np.pi)))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * gap + 1, 2 * gap + 1))
    count, labels = cv2.connectedComponents(cv2.morphologyEx(core, cv2.MORPH_CLOSE, disc))
    largest = 1 + int(np.bincount(labels.ravel(), minlength=count)[1:].argmax())
    rows, columns = np.nonzero(labels == largest)
    (x, y), reach = cv2.minEnclosingCircle(np.stack([columns, rows], axis=1).astype(np.int32))
    hull = cv2.convexHull(np.stack([columns, rows], axis=1).astype(np.int32))
    moments = cv2.moments(hull)
    if moments["m00"] > 0.0:
        x, y = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
        reach = float(np.sqrt(moments["m00"] / np.pi))
    f, half = change.factor, 0.5 * (change.factor - 1)
    return Circle(x * f + half, y * f + half, max(reach, 1.0) * f)


def _result(
    press: Array,
    change: ScaledDifference,
    contour: Contour,
    region: Mask,
    reaches: bool,
    drift: float,
) -> Indentation:
    circle = contour.circle
    inside = distance_in_radii(press.shape[:2], circle) < 1.0
    noise = np.array(change.noise)
    signal = float(np.sqrt(np.mean((change.difference[inside] / noise) ** 2)))
    saturated = float(np.mean(press[inside].max(axis=1) >= SATURATED))
    disturbed = np.zeros(press.shape[:2], dtype=np.bool_)
    large = np.repeat(np.repeat(region, change.factor, axis=0), change.factor, axis=1)
    disturbed[: large.shape[0], : large.shape[1]] = large
    return Indentation(
        centre=(circle.x, circle.y),
        contact_radius_px=circle.radius,
        contour=contour.points,
        residual_px=contour.residual_px,
        centre_sd_px=contour.centre_sd_px,
        axis_ratio=contour.axis_ratio,
        coverage=contour.coverage,
        disturbed=disturbed,
        noise=change.noise,
        gain=change.gain,
        signal_to_noise=signal,
        touches_border=reaches,
        quality=judge_indentation(contour, signal, change.gain, drift, saturated),
    )
