"""An indentation in an image: its contact, its judged figures, and one placed by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import Finding, QualityTable, judge
from gelpolight_core.image.noise import (
    LARGEST_GAIN_CHANGE,
    ScaledDifference,
    change_where,
    prepare_pair,
    scale_difference,
)
from gelpolight_core.masks import SATURATED
from gelpolight_core.reflectance.contour import Circle, Contour, distance_in_radii
from gelpolight_core.reflectance.indentation_checks import (
    DETECTION,
    LARGEST_LIGHT_CHANGE,
    LARGEST_SD,
    ROUND_FROM,
    reaches_border,
)
from gelpolight_core.session.decisions import PLACED_SD_PX

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

LEAST_PLACED_INSIDE = 0.9


@dataclass(frozen=True, slots=True)
class Indentation:
    """One ball's indentation in an image.

    The circle is the image of the contact's edge: where the membrane leaves the ball, marked by
    the kink of the shading and not by a threshold. Its centre is the image of the edge's centre, at
    the depth of the edge. The lowest point of the ball is deeper. With an oblique view, it
    therefore appears a few pixels nearer to the foot point of the image.

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
    centre_sd_px, radius_sd_px : float
        Standard deviations of the centre, along the worse axis, and of the radius.
    found_by : str
        Source of the circle: ``edge``, ``shading``, or ``hand`` if the user placed it.
    axis_ratio : float
        Shorter over longer axis of the ellipse through the contour.
    stretches : tuple of float
        Logarithm of the axis along y over that along x, by the edge and by the shading.
    coverage : float
        Share of the directions in which the edge was seen, 0..1.
    disturbed : (rows, columns) bool
        Area around the contact that differs from the background: contact, drape, shadow.
    noise : tuple of 3 floats
        Standard deviation of the difference of the two images per channel, 0..1.
    gain : tuple of 3 floats
        Brightness of the image over the background's where nothing touches, per channel.
    signal_to_noise : float
        Root mean square difference inside the contact over the noise of one pixel.
    touches_border : bool
        Whether `disturbed` reaches the border of the image or of the working area (the contact
        itself does not).
    quality : QualityTable
        The judged figures.
    """

    centre: tuple[float, float]
    contact_radius_px: float
    contour: NDArray[np.float64]
    residual_px: float
    centre_sd_px: float
    radius_sd_px: float
    found_by: str
    axis_ratio: float
    stretches: tuple[float, ...]
    coverage: float
    disturbed: Mask
    noise: tuple[float, float, float]
    gain: tuple[float, float, float]
    signal_to_noise: float
    touches_border: bool
    quality: QualityTable

    @property
    def circle(self) -> Circle:
        """The contact's edge, in pixels."""
        return Circle(*self.centre, self.contact_radius_px)


def indentation_at(
    press: Array,
    background: Array,
    circle: Circle,
    *,
    valid: Mask | None = None,
    name: str = "press",
) -> Indentation:
    """Describe an indentation whose contact the user has placed.

    Parameters
    ----------
    press, background, valid, name
        As in :func:`~gelpolight_core.reflectance.ball_detection.find_indentation`.
    circle : Circle
        The contact's edge as placed, pixels.

    Returns
    -------
    Indentation
        With the placed circle as its contour, and the uncertainty of placing by hand.

    Raises
    ------
    InputError
        If the images cannot be compared, or the circle reaches beyond the working area.
    """
    press, background, area = prepare_pair(press, background, valid, name=name)
    change = scale_difference(press, background, area)
    within = distance_in_radii(area.shape, circle) < 1.0
    if not within.any() or np.count_nonzero(within & area) < LEAST_PLACED_INSIDE * np.pi * (
        circle.radius**2
    ):
        raise InputError(
            "the contact placed by hand reaches beyond the working area",
            name,
            Remedy.MOVE_INSIDE,
        )
    turns = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    points = np.stack(
        [circle.x + circle.radius * np.cos(turns), circle.y + circle.radius * np.sin(turns)], axis=1
    )
    contour = Contour(circle, points, 0.0, 1.0, 1.0, PLACED_SD_PX)
    region = np.asarray(change.scaled > DETECTION)
    far = area & (distance_in_radii(area.shape, circle) > 2.0)
    light_change = change_where(change, background, far)
    reaches = reaches_border(region, change.valid_small)
    return describe_indentation(press, change, contour, region, reaches, light_change, "hand")


def describe_indentation(
    press: Array,
    change: ScaledDifference,
    contour: Contour,
    region: Mask,
    reaches: bool,
    light_change: float,
    found_by: str,
) -> Indentation:
    """Return an indentation with its judged figures.

    Parameters
    ----------
    press : (rows, columns, 3)
        The image.
    change : ScaledDifference
        Its difference to the background.
    contour : Contour
        The contact's edge.
    region : bool
        The disturbed pixels, on the coarse grid of `change`.
    reaches : bool
        Whether they reach the border of the working area.
    light_change : float
        Relative change far from the contact.
    found_by : str
        ``edge``, ``shading`` or ``hand``.
    """
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
        radius_sd_px=contour.centre_sd_px,
        found_by=found_by,
        axis_ratio=contour.axis_ratio,
        stretches=contour.stretches,
        coverage=contour.coverage,
        disturbed=disturbed,
        noise=change.noise,
        gain=change.gain,
        signal_to_noise=signal,
        touches_border=reaches,
        quality=_judge(contour, signal, change.gain, light_change, saturated),
    )


def _judge(
    contour: Contour,
    signal: float,
    gain: tuple[float, float, float],
    light_change: float,
    saturated: float,
) -> QualityTable:
    """Judge the figures of an indentation that was not refused.

    `signal` is the root mean square difference inside the contact over the noise of a pixel; `gain`
    the brightness over the background's, per channel; `saturated` a share of the contact.
    """
    again = "Capture the press again, or leave it out"
    light = "Let the LEDs warm up and capture the background again"
    radius = contour.circle.radius
    gain_change = 100.0 * max(abs(g - 1.0) for g in gain)
    label = {
        "centre_sd": "Uncertainty of the centre",
        "axis_ratio": "Roundness",
        "signal_to_noise": "Signal to noise",
        "gain_change": "Brightness against the background",
        "drift": "Change far from the contact",
        "saturated": "Saturated inside the contact",
    }

    def figure(
        key: str, value: float, unit: str, warn: float, fail: float | None, advice: str
    ) -> Finding:
        high = key in {"axis_ratio", "signal_to_noise"}
        limits = {"warn": warn, "fail": fail}
        return judge(key, label[key], value, unit, **limits, remedy=advice, higher_is_better=high)

    deeper = "Average several frames or press deeper"
    ratio = figure("axis_ratio", contour.axis_ratio, "", 0.9, None, again)
    return QualityTable(
        (
            judge("contact_radius", "Contact radius", radius, "px"),
            figure("centre_sd", contour.centre_sd_px, "px", LARGEST_SD * radius, None, again),
            *((ratio,) if contour.coverage > ROUND_FROM else ()),
            figure("signal_to_noise", signal, "", 2.0, None, deeper),
            figure("gain_change", gain_change, "%", 5.0, 100.0 * LARGEST_GAIN_CHANGE, light),
            figure("drift", 100.0 * light_change, "%", 3.0, 100.0 * LARGEST_LIGHT_CHANGE, light),
            figure("saturated", 100.0 * saturated, "%", 5.0, None, Remedy.SHORTER_EXPOSURE),
        )
    )
