"""Errors of slope and height of presses left out of an in-place calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.geometry.fits import algebraic_sphere
from gelpolight_core.reconstruction.closed_sensor.closed_depth import integrate_free_border
from gelpolight_core.reconstruction.height_map import surface_slopes
from gelpolight_core.sensor.closed_sensor.colour_change import ColourChange
from gelpolight_core.sensor.closed_sensor.slope_model import ErrorCurve, evaluate_slopes

from .ball_contact import BallContact, offsets_from_centre

INSIDE = 0.9
"""Share of the contact radius in which normals and shape are compared."""
FAR = 2.2
"""Distance from the centre, in contact radii, beyond which the membrane counts as untouched."""
CURVE_NODES = 6


@dataclass(frozen=True, slots=True)
class HeldOutPress:
    """A press compared with the result of the calibration without it.

    Attributes
    ----------
    normal_deg : float
        Mean angle between the normals and the ball's.
    cap_ratio : float
        Height over the ball's, by regression of the slopes inside the contact; NaN where the border
        cuts it: such a press is not measured.
    diameter_ratio : float
        Diameter of the sphere through the depth over the ball's.
    slope : (N,)
        Size of the ball's slope at nodes inside the contact.
    error : (N,)
        Root mean square error of the slope's components there.
    floor : float
        Root mean square of the depth far from the contact, nodes.
    colour_per_slope : float
        Root mean square change of colour over that of the ball's slope, inside the contact.
    """

    normal_deg: float
    cap_ratio: float
    diameter_ratio: float
    slope: Float64Array
    error: Float64Array
    floor: float
    colour_per_slope: float


def held_out_press(
    colours: ColourChange, ball: BallContact, coefficients: Float64Array
) -> HeldOutPress:
    """Compare the result of coefficients for a press with its ball.

    Parameters
    ----------
    colours : ColourChange
        The press.
    ball : BallContact
        Where it is, nodes.
    coefficients : (terms, 2)
        Fitted without it.
    """
    slope_x, slope_y = evaluate_slopes(coefficients, colours.change)
    rho, inside, dx, dy, expected = _inside(colours, ball)
    weight = colours.usable.astype(np.float32)
    depth = integrate_free_border(slope_x, slope_y, pitch_mm=1.0, weight=weight)[0]
    fitted_x, fitted_y = surface_slopes(depth, 1.0)
    fitted = np.stack([fitted_x[inside], fitted_y[inside]], axis=-1).astype(np.float64)
    far_depth = depth[(rho > FAR * ball.contact) & colours.usable]
    border = np.concatenate([rho[0], rho[-1], rho[:, 0], rho[:, -1]])
    height = (fitted * expected).sum() / (expected**2).sum()
    places = np.stack([dx + ball.x, dy + ball.y], axis=-1)
    at_rest, surface = ball.rest.slopes(places), depth[inside] - ball.rest.height(places)
    return HeldOutPress(
        float(np.degrees(_angles(fitted - at_rest, expected - at_rest)).mean()),
        float(height) if border.min() > ball.contact else np.nan,
        algebraic_sphere(np.column_stack([dx, dy, surface]).astype(np.float64))[1] / ball.radius,
        np.hypot(expected[:, 0], expected[:, 1]),
        np.sqrt(0.5 * ((fitted - expected) ** 2).sum(axis=1)),
        float(np.sqrt(np.mean(far_depth**2))) if far_depth.size else np.nan,
        float(np.sqrt((colours.change[inside] ** 2).sum() / max((expected**2).sum(), 1e-12))),
    )


def _inside(
    colours: ColourChange, ball: BallContact
) -> tuple[Float32Array, BoolArray, Float64Array, Float64Array, Float64Array]:
    """Return distances, nodes inside the contact, their x and y, and the ball's slopes there."""
    rows, columns = colours.usable.shape
    from_x, from_y, rho = offsets_from_centre((rows, columns), ball)
    inside = (rho < INSIDE * ball.contact) & colours.usable
    dx, dy = (np.asarray(a[inside], np.float64) for a in (from_x, from_y))
    return rho, inside, dx, dy, ball.slopes(dx, dy)


def _angles(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the angles (N,) between the normals of slopes (N, 2), radians."""
    first = np.column_stack([a, np.ones(len(a))])
    second = np.column_stack([b, np.ones(len(b))])
    across = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(across, (first * second).sum(axis=1)))


def held_out_slope_ratios(
    colours: Sequence[ColourChange],
    balls: Sequence[BallContact],
    coefficients: Sequence[Float64Array],
) -> Float64Array:
    """Return the ratio (presses,) of found to true slopes of presses that were left out.

    Regression on noisy colours underestimates slopes.

    Parameters
    ----------
    colours, balls
        seen, balls
    coefficients : sequence of (terms, 2)
        Fitted without each.
    """

    def share(item: tuple[ColourChange, BallContact, Float64Array]) -> float:
        change, ball, fitted = item
        fitted_x, fitted_y = evaluate_slopes(fitted, change.change)
        _, inside, _, _, expected = _inside(change, ball)
        total = (fitted_x[inside] * expected[:, 0] + fitted_y[inside] * expected[:, 1]).sum()
        return float(total / max((expected**2).sum(), 1e-12))

    return np.array(list(in_parallel(share, list(zip(colours, balls, coefficients, strict=True)))))


def explained_share(presses: Sequence[HeldOutPress]) -> float:
    """Return the share of the squared slopes of presses left out that was found, below 0 for none.

    Parameters
    ----------
    presses : sequence of HeldOutPress
        Each left out in its turn.
    """
    error, slope = (
        np.concatenate([getattr(press, name) for press in presses]) for name in ("error", "slope")
    )
    # An error is that of one of two components.
    return float(1.0 - 2.0 * (error**2).sum() / max((slope**2).sum(), 1e-12))


def error_curve(presses: Sequence[HeldOutPress], *, pitch_mm: float) -> ErrorCurve:
    """Return the errors of slopes and depths of presses left out.

    Parameters
    ----------
    presses : sequence of HeldOutPress
        Each left out in its turn.
    pitch_mm : float
        Length of a node.
    """
    slope = np.concatenate([press.slope for press in presses])
    error = np.concatenate([press.error for press in presses])
    edges = np.quantile(slope, np.linspace(0.0, 1.0, CURVE_NODES + 1))
    slopes, errors = [], []
    for low, high in pairwise(edges):
        in_part = (slope >= low) & (slope <= high)
        slopes.append(float(slope[in_part].mean()))
        errors.append(float(np.sqrt(np.mean(error[in_part] ** 2))))
    caps = np.array([press.cap_ratio for press in presses])
    caps = caps[np.isfinite(caps)]
    floors = np.array([press.floor for press in presses])
    floors = floors[np.isfinite(floors)]
    return ErrorCurve(
        np.array(slopes),
        np.array(errors),
        float(np.sqrt(np.mean((caps - 1.0) ** 2))) if caps.size else 1.0,
        float(np.median(floors)) * pitch_mm if floors.size else 0.0,
    )
