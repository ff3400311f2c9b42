"""The drape around one corner of an indenter: a quarter-plane pressed into the membrane."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter
from scipy.special import kv

from gelpolight_core.base.arrays import Float64Array

from .interpolation import sample_bilinear

_WEDGE = 1.5 * np.pi
"""Angle of the free membrane around a corner of 90 degrees."""
_REACH = 16.0
"""Range of the table, in decay lengths. Beyond it, the drape is below 1e-6 of the height."""
_RADII, _ANGLES = 161, 99
"""Table size. No angle is pi / 4, where the integrand is singular."""
_FINER = 4
"""Subdivision of the table by splines. The error of linear interpolation is then below 1e-5."""
_MARGIN = 8
"""Nodes beyond the corner and the face, so that the spline has no kink there."""
_ROUNDING = 0.07
"""Strength of the rounding of a corner whose three edges carry one fillet, from the numerical
solution of the obstacle problem (the tests solve it again)."""


def corner_drape(
    x: Float64Array, y: Float64Array, *, edge: float = 0.0, rounding: float = 0.0
) -> Float64Array:
    """Return the membrane's depth outside the quarter plane x <= 0, y <= 0, which has depth 1.

    The solution of laplacian(w) = w with w = 1 on the two faces; lengths in decay lengths.
    Inside the quarter plane the result is 1.

    Parameters
    ----------
    x, y : arrays of one shape
        Distances beyond the two faces, in decay lengths.
    edge : float, optional
        Radius of the fillet of the two edges, in decay lengths. Nearer to the corner, the rounding
        does not increase any more.
    rounding : float, optional
        Strength of the corner's own rounding, from :func:`fillet_rounding` or from a fit.

    Notes
    -----
    Kontorovich-Lebedev integral of a wedge of angle alpha = 3 pi / 2::

        w(r, t) = 2/pi int_0^inf K_i tau(r) cosh(pi tau / 2) cosh(t tau) / cosh(alpha tau / 2) d tau

    with t the angle from the wedge's bisector. It is tabulated once over r**(2/3), the power with
    which w leaves the corner, so that the table is smooth there. The shape of a corner on a scale
    below the decay length changes only the strength of one solution farther out: K_2/3(r) cos(2 t /
    3), which is zero on both faces and decreases outwards.
    """
    radius = np.hypot(x, y)
    # Angle from the bisector of the free membrane. The bisector has the direction (1, 1).
    angle = np.abs(np.arctan2(y - x, x + y))
    row = np.minimum(radius / _REACH, 1.0) ** (2.0 / 3.0) * (_FINER * (_RADII - 1))
    column = np.minimum(angle / (_WEDGE / 2.0), 1.0) * (_FINER * (_ANGLES - 1))
    depth = sample_bilinear(_table(), row, column)
    straight = np.exp(-np.clip(np.maximum(x, y), 0.0, _REACH))
    far = np.where((x > 0.0) & (y > 0.0), 0.0, straight)
    drape = np.clip(np.where(radius < _REACH, depth, far), 0.0, 1.0)
    if rounding == 0.0:
        return np.asarray(drape)
    nodes, bessel = _bessel_table()
    fall = np.interp(np.maximum(radius, edge), nodes, bessel, right=0.0)
    lost = rounding * fall * np.cos(2.0 * angle / 3.0)
    return np.asarray(drape - np.where((x > 0.0) | (y > 0.0), lost, 0.0))


def fillet_rounding(edge: float) -> float:
    """Return the strength of the rounding of a corner whose three edges carry one fillet.

    Parameters
    ----------
    edge : float
        Radius of the fillet, in decay lengths.
    """
    return float(_ROUNDING * edge ** (4.0 / 3.0))


@lru_cache(maxsize=1)
def _bessel_table() -> tuple[Float64Array, Float64Array]:
    """Return nodes and K_2/3 there, dense where it is steep."""
    nodes = np.geomspace(1e-3, _REACH, 4000)
    return nodes, np.asarray(kv(2.0 / 3.0, nodes))


@lru_cache(maxsize=1)
def _table() -> Float64Array:
    """Return the drape over (r ** (2/3), angle from the bisector), fine enough to be linear."""
    radii = _REACH * np.linspace(0.0, 1.0, _RADII) ** 1.5
    angles = _WEDGE / 2.0 / (_ANGLES - 1) * np.arange(_ANGLES + _MARGIN)
    values = np.stack([_wedge_drape(radii, float(angle)) for angle in angles], axis=1)
    values[0] = 1.0
    values = np.concatenate([2.0 - values[_MARGIN:0:-1], values])
    spline = spline_filter(values, order=3, mode="mirror")
    rows = _MARGIN + np.arange(_FINER * (_RADII - 1) + 1) / _FINER
    columns = np.arange(_FINER * (_ANGLES - 1) + 1) / _FINER
    positions = np.meshgrid(rows, columns, indexing="ij")
    return np.asarray(map_coordinates(spline, positions, order=3, prefilter=False, mode="mirror"))


def _wedge_drape(radii: Float64Array, angle: float) -> Float64Array:
    """Return the drape on one ray from the corner.

    With K_i tau(r) written as the integral of exp(-r cosh t) cos(tau t), the integral over tau has
    a closed form. The remaining integrand decays doubly exponentially in t. If the ray lies in
    front of a face, the residue of the pole adds exp(-distance to the face), the drape of a
    straight edge.
    """
    # The kernel narrows to a spike at t = 0 where the ray passes a face's end; sinh packs nodes.
    t = 12.0 * np.sinh(np.linspace(0.0, 9.0, 400)) / np.sinh(9.0)
    kernel = _kernel(t, np.pi / 2.0 + angle) + _kernel(t, np.pi / 2.0 - angle)
    drape = np.trapezoid(np.exp(-radii[:, None] * np.cosh(t)) * kernel, t, axis=1)
    if angle > np.pi / 4.0:
        drape = drape + np.exp(-radii * np.sin(_WEDGE / 2.0 - angle))
    return np.asarray(drape)


def _kernel(t: Float64Array, b: float) -> Float64Array:
    """Return 1/pi of the integral of cos(tau t) cosh(b tau) / cosh(alpha tau / 2) over tau."""
    c = _WEDGE / 2.0
    return np.asarray(
        np.cos(np.pi * b / (2.0 * c))
        * np.cosh(np.pi * t / (2.0 * c))
        / (c * (np.cos(np.pi * b / c) + np.cosh(np.pi * t / c)))
    )
