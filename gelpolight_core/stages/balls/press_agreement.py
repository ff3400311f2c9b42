"""Compare ball presses with each other, to find wrong stated radii and stretched contacts.

The other presses give the membrane's curve (brightness over the light's cosine, Eq. 6). With this
curve, the radius and the centre of a press follow from its own shading. If the radius is as stated,
the press agrees with the others. The joint refinement finds an error that all presses share.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import cv2
import numpy as np
from scipy.optimize import least_squares

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.finding import Finding, Verdict, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.directions import light_directions
from gelpolight_core.stages.flat_field.whiteboard_stage import LightIntensityResult

from .ball_press import LEAST_VALUE, BallPress, contact_mask

LEAST_PRESSES = 4
"""With fewer presses, it is unknown which of two different presses is wrong."""
BINS = np.linspace(0.05, 1.0, 39)
LEAST_IN_BIN = 8
RADIUS_WARN_PERCENT, RADIUS_FAIL_PERCENT = 15.0, 25.0
ODD_CHANGE = 0.2
ODD_WARN_PERCENT = 15.0
SIGMAS = 3.0
"""Of a correct calibration, 1 in 370 is marked as not round."""


@dataclass(frozen=True, slots=True)
class PressAgreement:
    """Agreement of one ball press with the other presses.

    Attributes
    ----------
    name : str
        The image's file.
    stated_radius_mm, radius_mm : float
        Radius of the ball: as stated, and as fitted to the shading of the press.
    moved_share : float
        Displacement of the centre by the shading, as a share of the contact radius.
    misfit : float
        Relative misfit (robust) of the shading with the stated radius.
    odd_share : float
        Share of the contact that differs by more than a fifth from the best fit.
    usual_odd_share : float
        The median of this share over all presses.
    others_off_percent : float
        Root mean square of `radius_off_percent` of the other presses.
    """

    name: str
    stated_radius_mm: float
    radius_mm: float
    moved_share: float
    misfit: float
    odd_share: float
    usual_odd_share: float = 0.0
    others_off_percent: float = 0.0

    @property
    def radius_limit_percent(self) -> float:
        """Difference from which on this radius is odd, and not one of many that are off."""
        return max(RADIUS_WARN_PERCENT, SIGMAS * self.others_off_percent)

    @property
    def radius_off_percent(self) -> float:
        """Difference between stated and fitted radius in percent: the larger over the smaller."""
        ratio = self.stated_radius_mm / self.radius_mm
        return 100.0 * (max(ratio, 1.0 / ratio) - 1.0)

    @property
    def fault(self) -> Finding | None:
        """The most probable cause with its remedy, or None if the press agrees."""
        name, limit = PurePath(self.name).stem, ODD_WARN_PERCENT / 100.0
        if self.usual_odd_share > limit:
            text = "No press follows a single reflectance curve"
            remedy = (
                "On a very glossy membrane this is normal if the figures of the joint refinement"
                " pass; otherwise check the LEDs, the exposure and the ball diameters, and repeat"
                " mirror, whiteboard and background"
            )
        elif self.odd_share > limit:
            share = 100.0 * self.odd_share
            text = f"{share:.0f} % of the contact in {name} does not look like a ball"
            remedy = "Remove dirt, clean the membrane and press again, or leave the capture out"
        elif self.radius_off_percent > self.radius_limit_percent:
            text = (
                f"The diameter of {name} is stated as {2.0 * self.stated_radius_mm:g} mm, but"
                f" {2.0 * self.radius_mm:.2g} mm fits the other presses"
            )
            remedy = "Correct the diameter, or check the circle"
        elif self.moved_share > 0.25:  # a correct circle is never moved by more of its radius
            share = 100.0 * self.moved_share
            text = f"The circle of {name} is misplaced by {share:.0f} % of its radius"
            remedy = "Drag it onto the contact's edge"
        else:
            return None
        return Finding("agreement", text, verdict=Verdict.FAIL, remedy=remedy)

    @property
    def remedy(self) -> str:
        """The cause and the remedy without a full stop, or "" if the press agrees."""
        return "" if self.fault is None else self.fault.line[:-1]


@dataclass(frozen=True, slots=True)
class _PressPixels:
    """Thinned pixels of one contact: place from its centre, light, and value over L rho."""

    offset_mm: Float64Array
    light: Float64Array
    value: Float64Array
    valid: BoolArray

    def cosines(self, shift_mm: Float64Array, curvature: float) -> Float64Array:
        """Return (N, 3) cosines on a ball of radius 1 / curvature."""
        slope = (self.offset_mm - shift_mm) * curvature
        square = np.minimum((slope**2).sum(axis=1), 0.98)
        normal = np.column_stack([slope, -np.sqrt(1.0 - square)])
        return np.asarray(np.einsum("nkc,nc->nk", self.light, normal))


def compare_presses(
    presses: Sequence[BallPress],
    images: Sequence[Float32Array],
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    radiance: LightIntensityResult,
    factors: Float32Array,
) -> tuple[PressAgreement, ...]:
    """Judge each ball press against the others.

    Parameters
    ----------
    presses, images, table, led_positions_mm, radiance, factors
        As for :func:`~gelpolight_core.stages.balls.reflectance_stage.ball_scatter`.

    Returns
    -------
    tuple of PressAgreement
        In the order of the presses; empty with fewer than four, which cannot be compared.
    """
    if len(presses) < LEAST_PRESSES:
        return ()
    strength = radiance.radiance * factors
    pixels = [
        _gather(press, image, table, led_positions_mm, strength, radiance.usable)
        for press, image in zip(presses, images, strict=True)
    ]
    curves = np.array([_curve(p, b) for p, b in zip(presses, pixels, strict=True)])
    agreements = []
    for k, (press, contact) in enumerate(zip(presses, pixels, strict=True)):
        if contact.valid.any():
            agreements.append(_agreement(press, contact, _median(np.delete(curves, k, axis=0))))
    median_share = float(np.median([a.odd_share for a in agreements])) if agreements else 0.0
    squares = np.square([agreement.radius_off_percent for agreement in agreements])
    return tuple(
        replace(
            agreement,
            usual_odd_share=median_share,
            others_off_percent=float(np.sqrt((squares.sum() - square) / max(len(squares) - 1, 1))),
        )
        for agreement, square in zip(agreements, squares, strict=True)
    )


def agreement_figures(agreements: Sequence[PressAgreement]) -> tuple[Finding, ...]:
    """Return figures of the presses that agree least, or none without a comparison."""
    if not agreements:
        return ()
    odd = max(agreements, key=lambda a: a.radius_off_percent)
    poor = max(agreements, key=lambda a: a.odd_share)
    glossy = odd.usual_odd_share > ODD_WARN_PERCENT / 100.0
    return (
        judge(
            "press_radius_percent",
            f"Stated diameter against the other presses, worst ({odd.name})",
            odd.radius_off_percent,
            "%",
            warn=odd.radius_limit_percent,
            # If no press follows a curve, as with a glossy membrane, the curve cannot show a wrong
            # radius. The joint refinement compares the presses again.
            fail=None if glossy else max(RADIUS_FAIL_PERCENT, odd.radius_limit_percent),
            remedy="" if glossy else odd.remedy,
        ),
        judge(
            "press_dirt_percent",
            f"Contact that does not look like a ball, worst ({poor.name})",
            100.0 * poor.odd_share,
            "%",
            warn=ODD_WARN_PERCENT,
            remedy=poor.remedy,
        ),
    )


def _gather(
    press: BallPress,
    image: Float32Array,
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    strength: Float32Array,
    usable: BoolArray,
) -> _PressPixels:
    rows, columns = np.nonzero(contact_mask(press, table) & usable)
    # At most 1500 pixels.
    stride = max(rows.size // 1500, 1)
    rows, columns = rows[::stride], columns[::stride]
    points = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    light, _ = light_directions(led_positions_mm, table.surface.points(points))
    ray_slope = table.ray_slope[rows, columns].astype(np.float64)
    centre = press.seen_centre_mm(ray_slope.mean(axis=0)) if rows.size else np.zeros(2)
    raw = image[rows, columns].astype(np.float64)
    level = strength[rows, columns].astype(np.float64)
    valid = (raw > LEAST_VALUE) & (raw < SATURATED) & (level > 0.0)
    value = np.divide(raw, level, out=np.zeros_like(raw), where=level > 0.0)
    return _PressPixels(points - centre, light, value, valid)


def _curve(press: BallPress, pixels: _PressPixels) -> Float64Array:
    """Return the median value (3, bins) of a press for each cosine bin, NaN without data."""
    cosines = pixels.cosines(np.zeros(2), 1.0 / press.pose.radius_mm)
    curve = np.full((3, len(BINS) - 1), np.nan)
    for k in range(3):
        valid = pixels.valid[:, k]
        bin_index = np.digitize(cosines[valid, k], BINS) - 1
        value = pixels.value[valid, k]
        for b in range(len(BINS) - 1):
            inside = bin_index == b
            if inside.sum() >= LEAST_IN_BIN:
                curve[k, b] = np.median(value[inside])
    return curve


def _median(curves: Float64Array) -> Float64Array:
    """Return the median of curves (presses, 3, bins), constant beyond its ends."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a bin that no press has seen
        median = np.nanmedian(curves, axis=0)
    centres = 0.5 * (BINS[1:] + BINS[:-1])
    for channel in median:
        valid = np.isfinite(channel)
        channel[:] = np.interp(centres, centres[valid], channel[valid]) if valid.any() else 0.0
    return np.asarray(median)


def _agreement(press: BallPress, pixels: _PressPixels, curve: Float64Array) -> PressAgreement:
    centres = 0.5 * (BINS[1:] + BINS[:-1])
    scale = float(np.median(curve[curve > 0.0])) if (curve > 0.0).any() else 1.0
    contact_mm = press.contact_radius_mm

    def error(parameters: Float64Array) -> Float64Array:
        cosines = pixels.cosines(parameters[:2] * contact_mm, parameters[2] / contact_mm)
        expected = np.stack([np.interp(cosines[:, k], centres, curve[k]) for k in range(3)], 1)
        return np.asarray(((pixels.value - expected) / scale)[pixels.valid])

    # Displacement of the centre in contact radii, and contact radius over ball radius.
    start = np.array([0.0, 0.0, contact_mm / press.pose.radius_mm])
    stated_error = error(start)
    fits = [
        least_squares(
            error,
            [0.0, 0.0, steepness],
            bounds=([-0.6, -0.6, 0.02], [0.6, 0.6, 0.98]),
            loss="soft_l1",
            f_scale=0.02,
        )
        for steepness in (float(np.clip(start[2], 0.03, 0.97)), 0.5)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return PressAgreement(
        press.name,
        press.pose.radius_mm,
        contact_mm / float(best.x[2]),
        float(np.hypot(best.x[0], best.x[1])),
        robust_sd(stated_error),
        float(np.mean(np.abs(error(best.x)) > ODD_CHANGE)),
    )


def judge_roundness(presses: Sequence[BallPress], table: ResamplingTable) -> tuple[Finding, ...]:
    """Judge whether contacts are stretched, the more the nearer they are to the edge.

    A wrong index or thickness of a layer does: the error of the refracted ray grows with the
    square of the distance from the axis. The limit is the noise of the contacts. On the slope of a
    curved membrane, the drape makes contacts oval by as much: it is left out.

    Parameters
    ----------
    presses : sequence of BallPress
        With their contours on the grid of the table.
    table : ResamplingTable
        The correction.

    Returns
    -------
    tuple of Finding
        Empty with too few presses, or on a curved membrane.
    """
    axis_px = table.grid.to_index(np.zeros(2))
    offset_px = np.array([press.indentation.contour.mean(axis=0) - axis_px for press in presses])
    if len(presses) < LEAST_PRESSES or not offset_px.any() or not table.surface.flat:
        return ()
    share = (offset_px**2).sum(axis=1)
    share /= share.max()
    stretch = np.array(
        [_stretch(p.indentation.contour, a) for p, a in zip(presses, offset_px, strict=True)]
    )
    at_the_edge = float(share @ stretch) / float(share @ share)
    residual = stretch - at_the_edge * share
    sd = float(np.sqrt(residual @ residual / (len(share) - 1) / (share @ share)))
    return (
        judge(
            "contact_stretch_percent",
            "Contacts stretched towards the edge, after the correction of refraction",
            100.0 * abs(at_the_edge),
            "%",
            warn=100.0 * SIGMAS * sd,
            remedy=(
                "Check refractive index and thickness of the elastomer and the window, and that the"
                " lens still has the focus of its calibration"
            ),
        ),
    )


def _stretch(contour: Float64Array, direction: Float64Array) -> float:
    """Return the logarithm of a contour's extent along a direction over that across it."""
    _, (one, other), angle = cv2.fitEllipseDirect(contour.astype(np.float32).reshape(-1, 1, 2))
    angle_between = np.deg2rad(angle) - np.arctan2(direction[1], direction[0])
    return float(np.log(one / other) * np.cos(2.0 * angle_between))
