"""The light of the untouched membrane where the background image is saturated.

Under a near LED a background is often saturated. A press may be darker there, and can be solved if
the background's own light is known. It is the flat membrane's by the model, times what the coating
adds or takes, which changes slowly and is taken from the surroundings.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import find_objects, label

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import lit_mask, saturated_mask
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.sensor.sensor_calibration import FullModel
from gelpolight_core.stages.leds.crosstalk import unmix

from .depth_scale import direct_flat

REACH_MM = 2.0
"""Farther than this from a pixel that is not saturated, the coating is not known."""
MARGIN_MM = 0.2
"""The coating at the edge of the field may be incomplete or in shadow, and is not used."""


def fill_saturated_background(
    full: FullModel,
    bare: Float32Array,
    factors: Float32Array,
    crosstalk: Float64Array,
    table: ResamplingTable,
) -> tuple[Float32Array, Float32Array]:
    """Return background and reflectance factors with saturated places filled in.

    Parameters
    ----------
    full : FullModel
        With the background as it was measured, (rows, columns, 3), crosstalk removed.
    bare : (rows, columns, 3) float32
        The background as the camera saw it; NaN or 0 outside the field.
    factors : (rows, columns, 3) float32
        Reflectance factors (Eq. 9); 0 where unknown.
    crosstalk : (3, 3)
        Crosstalk of the camera's channels.
    table : ResamplingTable
        The grid and its rays.
    """
    lost = saturated_mask(bare) & table.valid[..., None]
    background, factors = full.background.copy(), factors.copy()
    reach = round(REACH_MM / table.grid.pitch_mm)
    # Places whose surroundings meet are filled together.
    size = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    anywhere = np.asarray(lost.any(axis=-1), np.uint8)
    places, _ = label(cv2.dilate(anywhere, size))
    for box in find_objects(places):
        light = _filled_light(full, bare[box], background[box], lost[box], crosstalk, table, box)
        some = lost[box].any(axis=-1)
        near = some & (cv2.distanceTransform(some.astype(np.uint8), cv2.DIST_L2, 5) <= reach)
        background[box][near] = light[near]
        known_mask = (factors[box] > 0.0).all(axis=-1)
        for k in range(3):
            evened = _evened(factors[box][..., k], known_mask, table.grid.pitch_mm)
            factors[box][..., k][near & ~known_mask] = evened[near & ~known_mask]
    return background, factors


def _filled_light(
    full: FullModel,
    bare: Float32Array,
    background: Float32Array,
    lost: BoolArray,
    crosstalk: Float64Array,
    table: ResamplingTable,
    box: tuple[slice, slice],
) -> Float32Array:
    """Return the light (rows, columns, 3) of a part of the membrane, saturated channels filled."""
    grid = table.grid
    places = np.stack(np.meshgrid(grid.x_mm[box[1]], grid.y_mm[box[0]]), axis=-1)
    view = view_directions(np.nan_to_num(table.ray_slope[box]).astype(np.float64))
    light_at_rest = direct_flat(full, places.reshape(-1, 2), view.reshape(-1, 3), table.surface)
    flat = np.asarray(light_at_rest.reshape(view.shape), np.float32)
    light = background.copy()
    margin = round(MARGIN_MM / grid.pitch_mm)
    field = cv2.erode(
        table.valid[box].astype(np.uint8), np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    )
    valid_mask = np.asarray(~lost.any(axis=-1) & (field > 0) & lit_mask(background))
    for k in range(3):
        share = _evened(background[..., k] / flat[..., k], valid_mask, grid.pitch_mm)
        light[..., k][lost[..., k]] = (share * flat[..., k])[lost[..., k]]
    # What the camera would have shown; from it the other channels follow.
    camera_light = np.where(lost, light @ crosstalk.T.astype(np.float32), bare)
    return unmix(np.asarray(camera_light, np.float32), crosstalk)


def _evened(values: Float32Array, valid_mask: BoolArray, pitch_mm: float) -> Float32Array:
    """Fill unknown values from their surroundings."""
    weight = valid_mask.astype(np.float32)
    total = np.where(valid_mask, values, 0.0).astype(np.float32)
    # A blur of 0.5 mm leaves out specks and noise.
    size = 0.5 / pitch_mm
    evened = np.zeros_like(total)
    # Wider and wider, until all of a hole is reached.
    while (evened == 0.0).any() and size < max(values.shape):
        share = cv2.GaussianBlur(weight, (0, 0), size)
        mean = cv2.GaussianBlur(total, (0, 0), size) / np.maximum(share, 1e-9)
        evened = np.where((evened == 0.0) & (share > 1e-3), mean, evened).astype(np.float32)
        size *= 1.5
    return evened
