"""Whether what was found in a picture is one whole ball's indentation, and how good it is.

Where something can be refused outright it is, by its reason; the rest becomes judged figures with
the same limits.
"""

from __future__ import annotations

from typing import NoReturn

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.reflectance.contour import (
    Circle,
    Contour,
    inner_shading,
    kink_along,
    kink_table,
)
from gelpolight_core.reflectance.noise import LARGEST_GAIN_CHANGE, ScaledDifference
from gelpolight_core.translation import tr

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Five standard deviations over three channels: one false pixel in about 60 000, and single pixels
# are opened away.
DETECTION = 5.0
SMALLEST_RADIUS_PX = 6.0
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


def reaches_border(region: Mask, valid: Mask) -> bool:
    """Whether a region touches the border of the picture or of the working area.

    Parameters
    ----------
    region, valid : (rows, columns) bool
        The disturbed region and the working area, on one grid.
    """
    framed = np.pad(valid, 1, constant_values=False).astype(np.uint8)
    inner = cv2.erode(framed, np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    return bool(np.any(region & ~inner))


def check_whole(contour: Contour, area: Mask, reaches: bool, name: str) -> None:
    """Refuse an indentation that the border cuts.

    Parameters
    ----------
    contour : Contour
        The contact's edge.
    area : (rows, columns) bool
        The working area.
    reaches : bool
        Whether the disturbed region touches the border.
    name : str
        The picture's name.

    Raises
    ------
    InputError
        If any of the edge lies outside, or most of it was not seen and the
        region touches the border.
    """
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


def check_one(change: ScaledDifference, circle: Circle, name: str) -> None:
    """Refuse a second disturbance that is about as strong and as large as the first.

    Parameters
    ----------
    change : ScaledDifference
        Of the two pictures.
    circle : Circle
        The first contact's edge.
    name : str
        The picture's name.

    Raises
    ------
    InputError
        If there is one.
    """
    f, half = change.factor, 0.5 * (change.factor - 1)
    rows, columns = np.indices(change.scaled.shape)
    distance = np.hypot(columns * f + half - circle.x, rows * f + half - circle.y) / circle.radius
    inside = change.scaled[distance < 1.0]
    if len(inside) == 0:
        return
    top = float(np.quantile(inside, 0.9))
    least = np.pi * max(0.4 * circle.radius, SMALLEST_RADIUS_PX) ** 2 / f**2
    for share in (0.35, 0.5, 0.7):
        # The first contact's own drape and shadow hang together with it; another press does not.
        hot = (change.scaled > max(DETECTION, share * top)) | (distance < 1.3)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(hot.astype(np.uint8))
        own = labels[distance < 1.3][0]
        areas = [s[cv2.CC_STAT_AREA] for i, s in enumerate(stats) if i not in (0, own)]
        if max(areas, default=0) > least:
            raise InputError(
                tr("there is more than one indentation"),
                where=name,
                advice=tr("Press one ball at a time"),
            )


def check_round(contour: Contour, name: str) -> None:
    """Refuse an edge that is not a ball's.

    Parameters
    ----------
    contour : Contour
        The contact's edge.
    name : str
        The picture's name.

    Raises
    ------
    InputError
        If it was seen in too few directions, or is oval, jagged or too small.
    """
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
    if radius < SMALLEST_RADIUS_PX:
        _refuse_shape(
            tr("the contact's radius is only {r:.1f} px, too small to use").format(r=radius), name
        )


def check_ball(sharp: Array, circle: Circle, name: str, *, noise_variance: float) -> None:
    """Refuse an indentation that is flat inside.

    Parameters
    ----------
    sharp : (rows, columns, 3) float32
        Difference of the pictures in units of its noise.
    circle : Circle
        The contact's edge.
    name : str
        The picture's name.
    noise_variance : float
        Of white noise in `sharp`, all three channels together.

    Raises
    ------
    InputError
        If the shading varies less inside than a ball's.
    """
    if inner_shading(sharp, circle, noise_variance=noise_variance) < _LEAST_INNER_SHADING:
        _refuse_shape(tr("the indentation is flat inside, which a ball's is not"), name)


def check_order(
    press: Array,
    background: Array,
    area: Mask,
    circle: Circle,
    name: str,
    background_name: str,
) -> None:
    """Refuse the pictures when the kink lies in the background.

    Parameters
    ----------
    press, background : (rows, columns, 3) float32
        The pictures.
    area : (rows, columns) bool
        The working area.
    circle : Circle
        The contact's edge.
    name, background_name : str
        The pictures' names.

    Raises
    ------
    InputError
        If the pictures seem to be swapped.
    """
    tables = [kink_table(p, area, circle, half_width=0.25) for p in (press, background)]
    before, after = (kink_along(table, circle.radius) for table in reversed(tables))
    # Texture and noise are alike in both pictures, so a narrow lead proves nothing.
    if before > 4.0 * after:
        raise InputError(
            tr("the indentation is in the background, not in the press"),
            where=f"{name}, {background_name}",
            advice=tr("Swap the two pictures, or take the background without contact again"),
        )


def check_drift(drift: float, name: str) -> None:
    """Refuse pictures between which the light changed.

    Parameters
    ----------
    drift : float
        Relative change far from the contact.
    name : str
        The picture's name.

    Raises
    ------
    InputError
        If it is more than a tenth.
    """
    if drift > _LARGEST_DRIFT:
        raise InputError(
            tr("the light changed by {drift:.0f} % far from the contact").format(
                drift=100.0 * drift
            ),
            where=name,
            advice=tr("Fix exposure and lights, then capture background and press again"),
        )


def _refuse_shape(found: str, name: str) -> NoReturn:
    raise InputError(
        found,
        where=name,
        advice=tr("Press a single clean ball straight down, or leave this picture out"),
    )


def judge_indentation(
    contour: Contour,
    signal: float,
    gain: tuple[float, float, float],
    drift: float,
    saturated: float,
) -> QualityTable:
    """Judge the figures of an indentation that was not refused.

    Parameters
    ----------
    contour : Contour
        The contact's edge.
    signal : float
        Root mean square difference inside the contact over the noise of one pixel.
    gain : tuple of 3 floats
        Brightness of the picture over the background's, per channel.
    drift : float
        Relative change far from the contact.
    saturated : float
        Share of the contact at the end of the scale.
    """
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
