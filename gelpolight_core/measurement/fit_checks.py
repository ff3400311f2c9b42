"""Reasons why a measurement is not reliable."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.finding import Finding, doubtful_finding
from gelpolight_core.reconstruction.height_map import Flag

from .indenter_fit import IndenterFit, Known
from .segmentation import FitWindow

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
    fit: IndenterFit, window: FitWindow, edge: Known | None = None
) -> tuple[Finding, ...]:
    """Return why a fit is doubtful.

    Parameters
    ----------
    fit : IndenterFit
        The fit.
    window : FitWindow
        What it was fitted to.
    edge : Known, optional
        The object's edge, if it was stated.
    """
    problems = (
        _other_part(window),
        _blurred(fit),
        _other_edge(fit, edge),
        None if fit.converged else doubtful_finding("not_converged", "the fit did not converge"),
        _wrong_shape(fit),
        _wide(fit),
        _odd_drape(fit),
        _cut_drape(window),
        _no_anchor(window),
    )
    return tuple(finding for finding in problems if finding is not None)


def _other_part(window: FitWindow) -> Finding | None:
    if window.other_mm is None:
        return None
    x_mm, y_mm = window.other_mm
    text = (
        f"at the border, at ({x_mm:.1f}, {y_mm:.1f}) mm, the membrane looks pressed, too: another "
        "contact, damage or dirt, or light that has changed"
    )
    return doubtful_finding("other_part", text)


def _blurred(fit: IndenterFit) -> Finding | None:
    if fit.more_blur_mm == 0.0:
        return None
    text = (
        f"the walls are blurred by {1e3 * fit.more_blur_mm:.0f} \N{MICRO SIGN}m more than by the "
        "camera at calibration: the lens is out of focus, the camera processes its images, or the "
        "object moved"
    )
    return doubtful_finding("blurred_walls", text)


def _no_anchor(window: FitWindow) -> Finding | None:
    if not (window.heightmap.flags[window.region.core] & np.uint8(Flag.UNANCHORED)).any():
        return None
    text = "the contact leaves too little of the boundary free, so the height has no zero level"
    return doubtful_finding("no_anchor", text)


def _wrong_shape(fit: IndenterFit) -> Finding | None:
    residual_um, shape = 1e3 * fit.residual_rms_mm, fit.shape
    best = min(fit.rivals_mm, key=lambda name: fit.rivals_mm[name], default="")
    if best and fit.rivals_mm[best] < BETTER_SHAPE * fit.residual_rms_mm:
        rival_um = 1e3 * fit.rivals_mm[best]
        text = (
            f"a {best} fits better (residual {rival_um:.0f} \N{MICRO SIGN}m) "
            f"than a {shape} ({residual_um:.0f} \N{MICRO SIGN}m)"
        )
        return doubtful_finding("shape", text)
    share = fit.residual_rms_mm / fit.values["height_mm"]
    if share > POOR_RESIDUAL:
        text = (
            f"the map departs from a {shape} by {residual_um:.0f} \N{MICRO SIGN}m, "
            f"{100.0 * share:.0f} % of its height"
        )
        return doubtful_finding("residual", text)
    return None


def _wide(fit: IndenterFit) -> Finding | None:
    sizes = ("side_a_mm", "side_b_mm") if fit.shape == "cuboid" else ("diameter_mm",)
    widest = max(fit.sd[key] / fit.values[key] for key in (*sizes, "height_mm"))
    if np.isfinite(widest) and widest <= LARGEST_SD:
        return None
    return doubtful_finding("uncertain", f"the sizes are uncertain by {100.0 * widest:.0f} %")


def _odd_drape(fit: IndenterFit) -> Finding | None:
    decay = fit.values["drape_decay_mm"]
    if 0.1 <= decay <= 3.0:
        return None
    return doubtful_finding("drape", f"the membrane falls off over {decay:.2f} mm around it")


def _other_edge(fit: IndenterFit, edge: Known | None) -> Finding | None:
    if fit.other_edge_mm is None or edge is None:
        return None
    text = (
        f"the map shows an edge radius of {fit.other_edge_mm:.2f} mm, "
        f"not {edge.value:.2f} mm as stated"
    )
    return doubtful_finding("edge_radius", text)


def _cut_drape(window: FitWindow) -> Finding | None:
    if window.seen_share >= SMALLEST_GROUND:
        return None
    text = f"only {100.0 * window.seen_share:.0f} % of the slope around the object is on the map"
    return doubtful_finding("cut_drape", text)
