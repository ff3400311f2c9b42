"""Reflectance factors of the bare membrane from the contact-free background (Eq. 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import SD_OF_MEDIAN
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.directions import flat_cosines
from gelpolight_core.light.reflectance_table import ReflectanceTable

from .whiteboard_stage import LightIntensityResult

LEAST_FACTOR = 0.02


@dataclass(frozen=True, slots=True)
class ReflectanceFactorResult:
    """Brightness of each membrane node relative to the theory for a uniform membrane.

    Attributes
    ----------
    factors : (rows, columns, 3) float32
        rho = I / I_t of Eq. (9), per channel; 0 if unknown.
    usable : (rows, columns) bool
        Nodes with light and a reflecting membrane.
    quality : QualityTable
        Figures, limits and advice.
    """

    factors: Float32Array
    usable: BoolArray
    quality: QualityTable


def calibrate_factors(
    background: Float32Array,
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    radiance: LightIntensityResult,
    reflectance: ReflectanceTable,
) -> ReflectanceFactorResult:
    """Compare the background with the theory for a uniform, flat membrane.

    Parameters
    ----------
    background : (rows, columns, 3) float32
        The contact-free membrane, resampled onto the grid.
    table, led_positions_mm, radiance, reflectance
        Results of earlier stages.
    """
    cosines = flat_cosines(table, led_positions_mm)
    factors = np.zeros(background.shape, dtype=np.float32)
    for k in range(3):
        theory = radiance.radiance[..., k] * reflectance.response(k, cosines[..., k])
        lit = radiance.usable & (theory > 0.0)
        factors[..., k][lit] = background[..., k][lit] / theory[lit]
    usable = (
        radiance.usable
        & (factors > LEAST_FACTOR).all(axis=2)
        & np.isfinite(factors).all(axis=2)
        & (background < SATURATED).all(axis=2)
    )
    factors[~usable] = 0.0
    flat = table.surface.flat
    quality = QualityTable(_judge(factors, usable, radiance.usable, flat))
    return ReflectanceFactorResult(factors, usable, quality)


def _judge(
    factors: Float32Array, usable: BoolArray, lit: BoolArray, flat: bool
) -> tuple[Finding, ...]:
    inside = factors[usable] if usable.any() else np.full((1, 3), np.nan, np.float32)
    sd = float((SD_OF_MEDIAN * np.median(np.abs(inside - np.median(inside, axis=0)), axis=0)).max())
    # On a curved membrane, whose light is not measured, gloss spreads the factors, too.
    evenness = (
        judge(
            "factor_spread_percent",
            "Reflectance factor, spread",
            100.0 * sd,
            "%",
            warn=15.0,
            fail=40.0,
            remedy="The membrane is uneven: coat it again, or repeat the whiteboard stage",
        ),
    )
    return (
        judge(
            "factor_median",
            "Reflectance factor, median over all channels",
            float(np.median(inside)),
        ),
        *(evenness if flat else ()),
        judge(
            "membrane_unusable_percent",
            "Dead share of the lit membrane",
            100.0 * float(1.0 - usable[lit].mean()) if lit.any() else 100.0,
            "%",
            warn=2.0,
            fail=20.0,
            remedy="Check the background image for holes, dirt or saturation",
        ),
    )
