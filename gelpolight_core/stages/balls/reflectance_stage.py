"""The reflectance stage: from all ball presses to one monotone table per channel (Eq. 6-8)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.directions import light_directions
from gelpolight_core.light.reflectance_table import ChannelFit, ReflectanceTable, fit_channel
from gelpolight_core.stages.flat_field.whiteboard_stage import LightIntensityResult

from .ball_geometry import BallPose, ball_surface
from .ball_press import LEAST_VALUE, BallPress, contact_mask
from .press_agreement import PressAgreement, agreement_figures, compare_presses

LEAST_COSINE = 0.05


@dataclass(frozen=True, slots=True)
class ReflectanceResult:
    """The reflectance table with its data.

    Attributes
    ----------
    table : ReflectanceTable
        G and R for each channel.
    fits : tuple of 3 ChannelFit
        Curve, bins and scatter of each channel.
    presses : tuple of BallPress
        The balls.
    quality : QualityTable
        Figures, limits and advice.
    agreements : tuple of PressAgreement
        How each press agrees with the others; empty where they were not compared.
    """

    table: ReflectanceTable
    fits: tuple[ChannelFit, ChannelFit, ChannelFit]
    presses: tuple[BallPress, ...]
    quality: QualityTable
    agreements: tuple[PressAgreement, ...] = ()


def ball_scatter(
    presses: Sequence[BallPress],
    images: Iterable[Float32Array],
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    radiance: LightIntensityResult,
    factors: Float32Array | None = None,
) -> list[tuple[Float64Array, Float64Array]]:
    """Return (cosines, processed values) of all ball pixels, one pair per channel.

    As in the paper, light and view are those of the flat membrane: the ball's normals are those
    straight above each node, relative to the seen centre of the contact.

    Parameters
    ----------
    presses, images : of equal length
        The balls and their images (rows, columns, 3), resampled.
    table, led_positions_mm, radiance
        Earlier stages.
    factors : (rows, columns, 3) float32, optional
        rho, fed back from Eq. (9); by default 1.
    """
    scatter = [[(np.empty(0), np.empty(0))] for _ in range(3)]
    for press, image in zip(presses, images, strict=True):
        inside = contact_mask(press, table) & radiance.usable
        rows, columns = np.nonzero(inside)
        if rows.size == 0:
            continue  # its whole contact is in an area without light on the whiteboard
        points = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
        centre = press.seen_centre_mm(
            table.ray_slope[rows, columns].mean(axis=0).astype(np.float64)
        )
        seen_ball = BallPose(
            (float(centre[0]), float(centre[1])), press.pose.radius_mm, press.pose.depth_mm
        )
        _, normals = ball_surface(points, np.zeros_like(points), seen_ball)
        light, _ = light_directions(led_positions_mm, table.surface.points(points))
        cosines = np.einsum("nkc,nc->nk", light, normals)
        values = image[rows, columns].astype(np.float64)
        strength = radiance.radiance[rows, columns].astype(np.float64)
        if factors is not None:
            strength = strength * factors[rows, columns]
        for k in range(3):
            valid = (
                (values[:, k] > LEAST_VALUE)
                & (values[:, k] < SATURATED)
                & (cosines[:, k] > LEAST_COSINE)
                & (strength[:, k] > 0.0)
            )
            scatter[k].append((cosines[valid, k], values[valid, k] / strength[valid, k]))
    return [
        (np.concatenate([c for c, _ in pairs]), np.concatenate([v for _, v in pairs]))
        for pairs in scatter
    ]


def calibrate_reflectance(
    presses: Sequence[BallPress],
    images: Sequence[Float32Array],
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    radiance: LightIntensityResult,
    factors: Float32Array | None = None,
) -> ReflectanceResult:
    """Fit the reflectance table to all ball presses, and compare the presses with each other.

    Parameters
    ----------
    presses, images, table, led_positions_mm, radiance, factors
        As for :func:`ball_scatter`; the presses are compared where the factors are known.

    Raises
    ------
    InputError
        If there is no press, or a channel's scatter is too poor for a curve.
    """
    if not presses:
        raise InputError("no ball press can be used", "balls", Remedy.PRESS_BALLS)
    scatter = ball_scatter(presses, images, table, led_positions_mm, radiance, factors)
    red, green, blue = (
        fit_channel(cosines, values, name=key)
        for key, (cosines, values) in zip(CHANNEL_KEYS, scatter, strict=True)
    )
    fits = (red, green, blue)
    reflectance = ReflectanceTable(
        (red.cosines, green.cosines, blue.cosines),
        (red.values, green.values, blue.values),
        np.array([f.coverage for f in fits]),
    )
    agreements: tuple[PressAgreement, ...] = ()
    if factors is not None:
        agreements = compare_presses(presses, images, table, led_positions_mm, radiance, factors)
    quality = QualityTable((*_judge(fits, presses), *agreement_figures(agreements)))
    return ReflectanceResult(reflectance, fits, tuple(presses), quality, agreements)


def _judge(
    fits: tuple[ChannelFit, ChannelFit, ChannelFit], presses: Sequence[BallPress]
) -> tuple[Finding, ...]:
    worst = max(presses, key=lambda p: p.shading_misfit)
    return (
        judge(
            "ball_presses",
            "Ball presses",
            float(len(presses)),
            warn=4.0,
            fail=0.5,
            higher_is_better=True,
            remedy="Press balls at five or more places",
        ),
        judge(
            "lowest_cosine",
            "Lowest cosine covered by all channels",
            float(max(f.coverage[0] for f in fits)),
            warn=0.4,
            fail=0.7,
            remedy="Press balls deeper, or smaller ones: steep walls are extrapolated",
        ),
        judge(
            "scatter_percent",
            "Scatter about the curve, widest channel",
            100.0 * max(f.spread for f in fits),
            "%",
            warn=8.0,
            fail=25.0,
            remedy=(
                "On a very glossy membrane this is normal if the figures of the joint"
                " refinement pass; otherwise check ball diameters and LED positions, then"
                " repeat the worst presses"
            ),
        ),
        judge(
            "outlier_percent",
            "Outliers filtered",
            100.0 * max(f.outlier_share for f in fits),
            "%",
            warn=5.0,
            fail=20.0,
            remedy="Clean the membrane and repeat the worst presses",
        ),
        judge(
            "worst_misfit_percent",
            f"Shading misfit of the worst press ({worst.name})",
            100.0 * worst.shading_misfit,
            "%",
            warn=10.0,
            fail=25.0,
            remedy=f"Repeat the press {worst.name}",
        ),
    )
