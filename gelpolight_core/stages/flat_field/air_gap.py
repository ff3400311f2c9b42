"""Air below the white board: it is dark where the light of an LED is totally reflected.

Light leaves the elastomer by the share of Fresnel, which is nearly 1 until it falls to 0 at the
critical angle. A board that touches the elastomer gets all light, at any angle.
"""

from __future__ import annotations

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array

SPACING_MM = 0.3
"""Distance of the points at which the light is compared. Their means over the area between them
have little noise."""
ROUNDS = 20
LEAST_POINTS = 100


def air_gap_share(
    light: Float32Array,
    expected: Float64Array,
    cosines: Float64Array,
    board: BoolArray,
    *,
    index: float,
    pitch_mm: float,
) -> float:
    """Return the share of a white board, 0..1, that has air below it.

    Contact and air are two models of the light of each point. Both have the same smooth lobe for
    each LED, fitted at all points, each by the model that explains it better.

    Parameters
    ----------
    light, expected : (rows, columns, 3)
        Board, and the light of a Lambertian LED on it, in any unit.
    cosines : (rows, columns, 3)
        Of the angles to the LEDs.
    board : (rows, columns) bool
        Where the board is.
    index : float
        Refractive index of the elastomer.
    pitch_mm : float
        Distance of the nodes.
    """
    step = max(round(SPACING_MM / pitch_mm), 1)
    thin = np.s_[::step, ::step]
    at, mean = board[thin], np.asarray(cv2.blur(light, (step, step)))
    measured, law = mean[thin][at].astype(np.float64), expected[thin][at]
    cosine, place = cosines[thin][at], np.argwhere(at) / max(at.shape)
    passed = transmission_to_air(cosine, index)
    # Elsewhere, air changes the light of no LED by much.
    shown = (passed < 0.5).any(axis=1)
    if np.count_nonzero(shown) < LEAST_POINTS:
        return 0.0
    lobes = [np.column_stack([np.ones_like(c), c, place]) for c in cosine.T]
    least_error, found = np.inf, np.zeros_like(shown)
    for air in (np.zeros_like(shown), np.ones_like(shown)):
        for _ in range(ROUNDS):
            contact_error, air_error = np.zeros(len(air)), np.zeros(len(air))
            for k, lobe in enumerate(lobes):
                model = law[:, k, None] * lobe
                through = np.where(air, passed[:, k], 1.0)
                factors, *_ = np.linalg.lstsq(through[:, None] * model, measured[:, k])
                contact = model @ factors
                contact_error += (measured[:, k] - contact) ** 2
                air_error += (measured[:, k] - passed[:, k] * contact) ** 2
            before, air = air, air_error < contact_error
            if np.array_equal(before, air):
                break
        error = float(np.minimum(contact_error, air_error).sum())
        if error < least_error:
            least_error, found = error, air
    return float(np.count_nonzero(found & shown) / np.count_nonzero(shown))


def transmission_to_air(cosine: Float64Array, index: float) -> Float64Array:
    """Return the share of unpolarised light that passes from the elastomer to air (Fresnel).

    Parameters
    ----------
    cosine : (...)
        Of the angle in the elastomer.
    index : float
        Refractive index of the elastomer.
    """
    outside = np.sqrt(np.clip(1.0 - index**2 * (1.0 - cosine**2), 0.0, None))
    across = (index * cosine - outside) / (index * cosine + outside)
    along = (index * outside - cosine) / (index * outside + cosine)
    return np.asarray(1.0 - 0.5 * (across**2 + along**2))
