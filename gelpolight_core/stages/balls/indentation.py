"""An indentation in an image: its contact, its judged figures, and one placed by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.image.scaled_difference import (
    LARGEST_GAIN_CHANGE,
    ScaledDifference,
    fill_holes_of_pair,
    mean_relative_change,
    scale_difference,
)
from gelpolight_core.session.decisions import PLACED_SD_PX

from .contact_contour import ContactContour, ImageCircle, distance_in_radii
from .indentation_checks import LARGEST_LIGHT_CHANGE, LARGEST_SD, ROUND_FROM

LEAST_PLACED_INSIDE = 0.9


@dataclass(frozen=True, slots=True)
class Indentation:
    """The indentation of one ball in an image.

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
    centre_sd_px : float
        Standard deviation of the centre along the worse axis.
    stretches : tuple of float
        Logarithm of the axis along y over that along x, by the edge and by the shading.
    noise : tuple of 3 floats
        Standard deviation of the difference of the two images per channel, 0..1.
    quality : QualityTable
        The judged figures.
    """

    centre: tuple[float, float]
    contact_radius_px: float
    contour: Float64Array
    centre_sd_px: float
    stretches: tuple[float, ...]
    noise: tuple[float, float, float]
    quality: QualityTable

    @property
    def circle(self) -> ImageCircle:
        """The contact's edge, in pixels."""
        return ImageCircle(*self.centre, self.contact_radius_px)


def indentation_at(
    press: Float32Array,
    background: Float32Array,
    circle: ImageCircle,
    *,
    valid: BoolArray | None = None,
    name: str = "press",
) -> Indentation:
    """Describe an indentation whose contact the user has placed.

    Parameters
    ----------
    press, background, valid, name
        As in :func:`~gelpolight_core.stages.balls.ball_detection.find_indentation`.
    circle : ImageCircle
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
    press, background, area = fill_holes_of_pair(press, background, valid, name=name)
    change = scale_difference(press, background, area)
    inside = distance_in_radii(area.shape, circle) < 1.0
    if not inside.any() or np.count_nonzero(inside & area) < LEAST_PLACED_INSIDE * np.pi * (
        circle.radius**2
    ):
        raise InputError(
            "the contact placed by hand reaches beyond the working area",
            name,
            Remedy.MOVE_INSIDE,
        )
    angles = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    offset = circle.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.array([circle.x, circle.y]) + offset
    contour = ContactContour(circle, points, 0.0, 1.0, 1.0, PLACED_SD_PX)
    outside = area & (distance_in_radii(area.shape, circle) > 2.0)
    light_change = mean_relative_change(change, background, outside)
    return describe_indentation(press, change, contour, light_change)


def describe_indentation(
    press: Float32Array, change: ScaledDifference, contour: ContactContour, light_change: float
) -> Indentation:
    """Return an indentation with its judged figures.

    Parameters
    ----------
    press : (rows, columns, 3)
        The image.
    change : ScaledDifference
        Its difference to the background.
    contour : ContactContour
        The contact's edge.
    light_change : float
        Relative change far from the contact.
    """
    circle = contour.circle
    inside = distance_in_radii(press.shape[:2], circle) < 1.0
    noise = np.array(change.noise)
    signal = float(np.sqrt(np.mean((change.difference[inside] / noise) ** 2)))
    saturated = float(np.mean(press[inside].max(axis=1) >= SATURATED))
    return Indentation(
        centre=(circle.x, circle.y),
        contact_radius_px=circle.radius,
        contour=contour.points,
        centre_sd_px=contour.centre_sd_px,
        stretches=contour.stretches,
        noise=change.noise,
        quality=QualityTable(_judge(contour, signal, change.gain, light_change, saturated)),
    )


def _judge(
    contour: ContactContour,
    signal: float,
    gain: tuple[float, float, float],
    light_change: float,
    saturated: float,
) -> tuple[Finding, ...]:
    """Judge the figures of an indentation that was not refused.

    `signal` is the root mean square difference inside the contact over the noise of a pixel; `gain`
    the brightness over the background's, per channel; `saturated` a share of the contact.
    """
    repeat = "Capture the press again, or leave it out"
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

    press_deeper = "Average several frames or press deeper"
    ratio = figure("axis_ratio", contour.axis_ratio, "", 0.9, None, repeat)
    return (
        judge("contact_radius", "Contact radius", radius, "px"),
        figure("centre_sd", contour.centre_sd_px, "px", LARGEST_SD * radius, None, repeat),
        *((ratio,) if contour.coverage > ROUND_FROM else ()),
        figure("signal_to_noise", signal, "", 2.0, None, press_deeper),
        figure("gain_change", gain_change, "%", 5.0, 100.0 * LARGEST_GAIN_CHANGE, light),
        figure("drift", 100.0 * light_change, "%", 3.0, 100.0 * LARGEST_LIGHT_CHANGE, light),
        figure("saturated", 100.0 * saturated, "%", 5.0, None, Remedy.SHORTER_EXPOSURE),
    )
