"""When a measurement is not reliable, and why."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import Finding, doubt
from gelpolight_core.measurement.fit import EdgePrior, FitResult, WindowData, fit_indenter
from gelpolight_core.measurement.indenter import MODELS
from gelpolight_core.measurement.segmentation import PressedRegion
from gelpolight_core.reconstruction.height_map import Flag

GOOD_RESIDUAL = 0.005
"""Residual, as a share of the height, up to which no other shape is tried."""
POOR_RESIDUAL = 0.06
"""Residual, as a share of the height, beyond which the map does not show this object. A wall that
is displaced by a tenth of the decay length causes this residual."""
BETTER_SHAPE = 0.75
"""Another shape is suggested if its residual is less than this share."""
LARGEST_SD = 0.05
"""Relative standard deviation beyond which a size is not measured."""
SMALLEST_GROUND = 0.8
"""Share of the object's surroundings that must be usable to show the drape."""


def fit_problems(
    shape: str,
    fit: FitResult,
    window: WindowData,
    region: PressedRegion,
    edge: EdgePrior,
) -> tuple[Finding | None, ...]:
    """Return why a fit is doubtful; None for what is not.

    Parameters
    ----------
    shape : str
        The shape that was fitted.
    fit : FitResult
        The fit.
    window : WindowData
        What it was fitted to.
    region : PressedRegion
        The segmented bump, from which rival shapes start.
    edge : EdgePrior
        As for the fit.
    """
    return (
        _other_edge(fit, edge),
        None if fit.converged else doubt("not_converged", "the fit did not converge"),
        _wrong_shape(shape, fit, window, region, edge),
        _wide(shape, fit),
        _odd_drape(fit),
        _cut_drape(window),
    )


def no_anchor(flags: NDArray[np.uint8] | None, region: PressedRegion) -> Finding | None:
    """Return why the height of an object is meaningless; None if its map has an anchor.

    Parameters
    ----------
    flags : (rows, columns) uint8 or None
        Of the height map.
    region : PressedRegion
        The segmented bump.
    """
    if flags is None or not (flags[region.core] & np.uint8(Flag.UNANCHORED)).any():
        return None
    text = "the contact leaves too little of the boundary free, so the height has no zero level"
    return doubt("no_anchor", text)


def residuals_of(
    shapes: Iterable[str], window: WindowData, region: PressedRegion, edge: EdgePrior
) -> dict[str, float]:
    """Return the residual (mm, root mean square) of each shape after one round of its fit."""
    return {
        shape: fit_indenter(
            MODELS[shape], window, MODELS[shape].start(region), edge=edge, most_rounds=1
        ).residual_rms_mm
        for shape in shapes
    }


def _wrong_shape(
    shape: str,
    fit: FitResult,
    window: WindowData,
    region: PressedRegion,
    edge: EdgePrior,
) -> Finding | None:
    share = fit.residual_rms_mm / fit.values["height_mm"]
    if share <= GOOD_RESIDUAL:
        return None
    # The corners of a cuboid alone cause a residual several times as large as that limit.
    tried = [name for name in MODELS if name != "cuboid" or share > 0.02]
    rivals = residuals_of([name for name in tried if name != shape], window, region, edge)
    best = min(rivals, key=lambda name: rivals[name])
    if rivals[best] < BETTER_SHAPE * fit.residual_rms_mm:
        text = "a {best} fits better (residual {rival:.0f} um) than a {shape} ({own:.0f} um)"
        rival, own = 1e3 * rivals[best], 1e3 * fit.residual_rms_mm
        return doubt("shape", text.format(best=best, rival=rival, shape=shape, own=own))
    if share > POOR_RESIDUAL:
        text = "the map departs from a {shape} by {own:.0f} um, {share:.0f} % of its height"
        own = 1e3 * fit.residual_rms_mm
        return doubt("residual", text.format(shape=shape, own=own, share=100.0 * share))
    return None


def _wide(shape: str, fit: FitResult) -> Finding | None:
    sizes = ("side_a_mm", "side_b_mm") if shape == "cuboid" else ("diameter_mm",)
    widest = max(fit.sd[key] / fit.values[key] for key in (*sizes, "height_mm"))
    if np.isfinite(widest) and widest <= LARGEST_SD:
        return None
    text = "the sizes are uncertain by {percent:.0f} %"
    return doubt("uncertain", text.format(percent=100.0 * widest))


def _odd_drape(fit: FitResult) -> Finding | None:
    decay = fit.values["drape_decay_mm"]
    if 0.1 <= decay <= 3.0:
        return None
    text = "the fitted decay length of the drape is {decay:.2f} mm"
    return doubt("drape", text.format(decay=decay))


def _other_edge(fit: FitResult, edge: EdgePrior) -> Finding | None:
    if fit.other_edge_mm is None:
        return None
    text = "the map shows an edge radius of {shown:.2f} mm, not {stated:.2f} mm as stated"
    text = text.format(shown=fit.other_edge_mm, stated=edge.edge_radius_mm)
    return doubt("edge_radius", text)


def _cut_drape(window: WindowData) -> Finding | None:
    if window.seen_share >= SMALLEST_GROUND:
        return None
    text = "only {percent:.0f} % of the drape around the object is on the map"
    return doubt("cut_drape", text.format(percent=100.0 * window.seen_share))
