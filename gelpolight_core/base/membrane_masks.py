"""When a pixel is saturated or dark, and when a node is usable or in contact: defined once.

Values are linear light, 0..1 of the camera's full scale.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import BoolArray

SATURATED = 0.995
"""From this value a pixel is saturated: its light is at least this much."""
LEAST_LIGHT = 0.01
"""Below this light of the untouched membrane, the ratio of press to background is noise."""
DARK_COSINE = 0.03
"""A channel whose light falls on the surface at a smaller cosine is in shadow."""
DARK_SIGMAS = 4.0
"""A channel within this number of standard deviations of no light is dark ..."""
DARK_SHARE = 0.15
"""... but not if it has this share of the flat membrane's light, for any noise."""
CONTACT_CHANGE = 5e-3
"""A contact changes the light by more than this share; less is below half a degree of slope."""
CONTACT_SIGMAS = 5.0
"""A contact changes the light by more than this number of standard deviations of its noise."""


def saturated_mask(light: NDArray[np.floating[Any]]) -> BoolArray:
    """Return which values are at the camera's upper end."""
    return np.asarray(light >= SATURATED)


def lit_mask(light: NDArray[np.floating[Any]]) -> BoolArray:
    """Return the nodes (...) whose untouched membrane has light in all channels (..., 3)."""
    return np.asarray((light > LEAST_LIGHT).all(axis=-1))


def usable_mask(
    valid: BoolArray, background: NDArray[np.floating[Any]], factors: NDArray[np.floating[Any]]
) -> BoolArray:
    """Return the nodes (rows, columns) that can be solved: in view, lit, with known reflectance.

    Parameters
    ----------
    valid : (rows, columns) bool
        In view and inside the working circle.
    background, factors : (rows, columns, 3)
        Light of the untouched membrane, and its reflectance factors (Eq. 9).
    """
    return np.asarray(valid & lit_mask(background) & (factors > 0.0).all(axis=-1))


def reflects_light(valid: BoolArray, background: NDArray[np.floating[Any]]) -> BoolArray:
    """Return the nodes (rows, columns) that reflect light onto other parts of the membrane.

    Unlike :func:`usable_mask` nodes, they can be saturated or lack a channel: only holes reflect
    none.

    Parameters
    ----------
    valid : (rows, columns) bool
        In view and inside the working circle.
    background : (rows, columns, 3)
        Light of the untouched membrane.
    """
    return np.asarray(valid & (background > LEAST_LIGHT).any(axis=-1))
