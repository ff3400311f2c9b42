"""A ball's indentation, found in a picture by itself.

Noise-scaled difference to the picture without contact, then the kink of the shading at the
contact's edge, then a circle through it. No light, camera or scale need be known, so the pictures
may be raw or resampled; everything is in pixels of the picture given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.reflectance.contour import (
    Circle,
    Contour,
    distance_in_radii,
    fit_edge,
    inner_shading,
    kink_along,
    kink_table,
)
from gelpolight_core.reflectance.noise import (
    LARGEST_GAIN_CHANGE,
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

# Five standard deviations over three channels: one false pixel in about 60 000, and single pixels
# are opened away.
_DETECTION = 5.0
_SMALLEST_RADIUS_PX = 6.0
_BLUR_PX = 0.8
# A circle seen through a lens at the field's rim stays above 0.95; two touching presses fall below
# 0.75.
_LEAST_AXIS_RATIO = 0.8
# A square's edge scatters by 0.08 to 0.1 of its mean radius.
_LARGEST_RESIDUAL = 0.07
_ALLOWED_RESIDUAL_PX = 1.5
_LEAST_COVERAGE = 0.35
_LARGEST_DRIFT = 0.1
# Variation of the shading in the inner half over that in the rim: 0.4 and more for a ball, whose
# slope grows at least linearly from the middle (0.28 for slopes, at a contact of 0.9 ball radii,
# where brightness has long flattened out); near 0 for a flat face.
_LEAST_INNER_SHADING = 0.25


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
    reaches = _reaches_border(region, change.valid_small)
    _check_whole(contour, area, reaches, name)
    far = area & (distance_in_radii(area.shape, contour.circle) > 2.0)
    drift = change_where(change, background, far)
    _check_drift(drift, name)
    _check_one(change, contour.circle, name)
    _check_round(contour, name)
    _check_ball(sharp, contour.circle, name)
    _check_order(press, background, area, contour.circle, name, background_name)
    return _result(press, change, contour, region, reaches, drift)


def _in_noise_units(change: ScaledDifference) -> Array:
    weights = np.diag(1.0 / np.array(change.noise, np.float32))
    blurred = cv2.GaussianBlur(change.difference, (0, 0), _BLUR_PX)
    return np.asarray(cv2.transform(blurred, weights), dtype=np.float32)


def _locate(change: ScaledDifference, name: str) -> tuple[Mask, Circle]:
    """Return the most disturbed region on the coarse grid, and a first circle about its core."""
    hot = (change.scaled > _DETECTION).astype(np.uint8)
    opened = cv2.morphologyEx(hot, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels = cv2.connectedComponents(opened)
    weight = np.bincount(labels.ravel(), change.scaled.ravel(), minlength=count)
    weight[0] = 0.0
    region = labels == int(weight.argmax())
    smallest = np.pi * (_SMALLEST_RADIUS_PX / change.factor) ** 2
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
    core = (region & (change.scaled > max(_DETECTION, 0.4 * top))).astype(np.uint8)
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


def _reaches_border(region: Mask, valid: Mask) -> bool:
    framed = np.pad(valid, 1, constant_values=False).astype(np.uint8)
    inner = cv2.erode(framed, np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    return bool(np.any(region & ~inner))


def _check_whole(contour: Contour, area: Mask, reaches: bool, name: str) -> None:
    circle = contour.circle
    angle = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    # A kink shows only with some membrane on its far side.
    column = np.rint(circle.x + (circle.radius + 1.0) * np.cos(angle)).astype(np.intp)
    row = np.rint(circle.y + (circle.radius + 1.0) * np.sin(angle)).astype(np.intp)
    rows, columns = area.shape
    within = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    within &= area[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    outside = 1.0 - float(within.mean())
    unclear = reaches and contour.coverage < _LEAST_COVERAGE
    if outside > 0.0 or unclear:
        raise InputError(
            tr("the border cuts the indentation; {share:.0f} % of its edge is out of view").format(
                share=100.0 * (outside if outside > 0.0 else 1.0 - contour.coverage)
            ),
            where=name,
            advice=tr("Press the ball nearer to the middle"),
        )


def _check_one(change: ScaledDifference, circle: Circle, name: str) -> None:
    """Refuse a second disturbance that is about as strong and as large as the first."""
    f, half = change.factor, 0.5 * (change.factor - 1)
    rows, columns = np.indices(change.scaled.shape)
    distance = np.hypot(columns * f + half - circle.x, rows * f + half - circle.y) / circle.radius
    inside = change.scaled[distance < 1.0]
    if len(inside) == 0:
        return
    top = float(np.quantile(inside, 0.9))
    least = np.pi * max(0.4 * circle.radius, _SMALLEST_RADIUS_PX) ** 2 / f**2
    for share in (0.35, 0.5, 0.7):
        # The first contact's own drape and shadow hang together with it; another press does not.
        hot = (change.scaled > max(_DETECTION, share * top)) | (distance < 1.3)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(hot.astype(np.uint8))
        own = labels[distance < 1.3][0]
        areas = [s[cv2.CC_STAT_AREA] for i, s in enumerate(stats) if i not in (0, own)]
        if max(areas, default=0) > least:
            raise InputError(
                tr("there is more than one indentation"),
                where=name,
                advice=tr("Press one ball at a time"),
            )


def _check_round(contour: Contour, name: str) -> None:
    radius = contour.circle.radius
    if contour.coverage < _LEAST_COVERAGE:
        _refuse_shape(tr("no round edge of a contact can be made out"), name)
    if contour.coverage > 0.75 and contour.axis_ratio < _LEAST_AXIS_RATIO:
        _refuse_shape(
            tr("the indentation is not round; its axes are as 1 to {ratio:.2f}").format(
                ratio=1.0 / max(contour.axis_ratio, 0.01)
            ),
            name,
        )
    if contour.residual_px > max(_LARGEST_RESIDUAL * radius, _ALLOWED_RESIDUAL_PX):
        _refuse_shape(
            tr("the indentation's edge lies {res:.1f} px about a circle of {r:.1f} px").format(
                res=contour.residual_px, r=radius
            ),
            name,
        )
    if radius < _SMALLEST_RADIUS_PX:
        _refuse_shape(
            tr("the contact's radius is only {r:.1f} px, too small to use").format(r=radius), name
        )


def _refuse_shape(found: str, name: str) -> NoReturn:
    raise InputError(
        found,
        where=name,
        advice=tr("Press a single clean ball straight down, or leave this picture out"),
    )


def _check_ball(sharp: Array, circle: Circle, name: str) -> None:
    # What a Gaussian leaves of white noise of variance 1, in three channels.
    noise = 3.0 / (4.0 * np.pi * _BLUR_PX**2)
    if inner_shading(sharp, circle, noise_variance=noise) < _LEAST_INNER_SHADING:
        _refuse_shape(tr("the indentation is flat inside, which a ball's is not"), name)


def _check_order(
    press: Array,
    background: Array,
    area: Mask,
    circle: Circle,
    name: str,
    background_name: str,
) -> None:
    """Refuse the pictures when the kink lies in the background."""
    tables = [kink_table(p, area, circle, half_width=0.25) for p in (press, background)]
    before, after = (kink_along(table, circle.radius) for table in reversed(tables))
    # Texture and noise are alike in both pictures, so a narrow lead proves nothing.
    if before > 4.0 * after:
        raise InputError(
            tr("the indentation is in the background, not in the press"),
            where=f"{name}, {background_name}",
            advice=tr("Swap the two pictures, or take the background without contact again"),
        )


def _check_drift(drift: float, name: str) -> None:
    if drift > _LARGEST_DRIFT:
        raise InputError(
            tr("the light changed by {drift:.0f} % far from the contact").format(
                drift=100.0 * drift
            ),
            where=name,
            advice=tr("Fix exposure and lights, then capture background and press again"),
        )


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
        quality=_judge(contour, signal, change.gain, drift, saturated),
    )


def _judge(
    contour: Contour,
    signal: float,
    gain: tuple[float, float, float],
    drift: float,
    saturated: float,
) -> QualityTable:
    again = tr("Capture the press again, or leave it out")
    light = tr("Let the lights warm up and take the background again")
    radius = contour.circle.radius
    residual = 100.0 * contour.residual_px / radius
    worst_residual = 100.0 * max(_LARGEST_RESIDUAL, _ALLOWED_RESIDUAL_PX / radius)
    gain_change = 100.0 * max(abs(g - 1.0) for g in gain)
    label = {
        "edge_residual": tr("Edge off the circle"),
        "centre_sd": tr("Uncertainty of the centre"),
        "axis_ratio": tr("Roundness"),
        "coverage": tr("Edge seen"),
        "signal_to_noise": tr("Signal to noise"),
        "gain_change": tr("Brightness against the background"),
        "drift": tr("Change far from the contact"),
        "saturated": tr("Saturated inside the contact"),
    }

    def figure(
        key: str, value: float, unit: str, warn: float, fail: float | None, advice: str
    ) -> Figure:
        high = key in {"axis_ratio", "coverage", "signal_to_noise"}
        limits = {"warn": warn, "fail": fail}
        return judge(key, label[key], value, unit, **limits, advice=advice, higher_is_better=high)

    lowest = 100.0 * _LEAST_COVERAGE
    middle, deeper = (
        tr("Press the ball nearer to the middle"),
        tr("Average several frames or press deeper"),
    )
    return QualityTable(
        (
            judge("contact_radius", tr("Contact radius"), radius, "px"),
            figure("edge_residual", residual, "%", 4.0, worst_residual, again),
            figure("centre_sd", contour.centre_sd_px, "px", 1.0, None, again),
            figure("axis_ratio", contour.axis_ratio, "", 0.9, None, again),
            figure("coverage", 100.0 * contour.coverage, "%", 70.0, lowest, middle),
            figure("signal_to_noise", signal, "", 2.0, None, deeper),
            figure("gain_change", gain_change, "%", 5.0, 100.0 * LARGEST_GAIN_CHANGE, light),
            figure("drift", 100.0 * drift, "%", 3.0, 100.0 * _LARGEST_DRIFT, light),
            figure("saturated", 100.0 * saturated, "%", 5.0, None, tr("Shorten the exposure")),
        )
    )
