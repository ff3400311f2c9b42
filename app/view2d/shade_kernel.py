"""Colours and shading of a relief in one pass over its pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.compiling import whole


@whole(fastmath=True)
def shade(
    depth: NDArray[np.float32],
    level: NDArray[np.float32],
    table: NDArray[np.uint8],
    colours: Any,
    light: Any,
    half_way: Any,
    strengths: Any,
    steepness: float,
    contour: float,
    out: NDArray[np.uint8],
) -> None:
    """Colour a depth map, shade it, and draw its contour lines.

    Parameters
    ----------
    depth : (rows, columns) float32
        The relief, mm.
    level : (rows, columns) float32
        Mean of the surroundings, mm. Lower points are in a hollow.
    table : (256, 3) uint8
        The colours.
    colours : (low, per_mm)
        Depth of the first colour, and colours per mm.
    light, half_way : (x, y, z)
        Unit vectors towards the lamp, and half way between lamp and viewer.
    strengths : (ambient, shine, hollow)
        Ambient light, specular light, and darkening of hollows per mm.
    steepness : float
        Slope for a difference of 1 mm between the pixels before and after.
    contour : float
        mm between contour lines; 0: none.
    out : (rows, columns, 3) uint8
        The image.
    """
    rows, columns = depth.shape
    low, per_mm = colours
    light_x, light_y, light_z = light
    half_x, half_y, half_z = half_way
    ambient, shine, hollow = strengths
    flat = half_z**24
    for i in range(rows):
        above, below = max(i - 1, 0), min(i + 1, rows - 1)
        for j in range(columns):
            left, right = max(j - 1, 0), min(j + 1, columns - 1)
            here = depth[i, j]
            across = depth[i, right] - depth[i, left]
            down = depth[below, j] - depth[above, j]
            slope_x, slope_y = across * steepness, down * steepness
            length = 1.0 / np.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
            bright = (light_z - light_x * slope_x - light_y * slope_y) * length / light_z
            dark = min(max(hollow * (level[i, j] - here), 0.0), 1.0)
            gain = min(max(ambient + (1.0 - ambient) * max(bright, 0.0) - dark, 0.12), 1.6)
            glint = max((half_z - half_x * slope_x - half_y * slope_y) * length, 0.0)
            glint8 = glint * glint
            glint8 *= glint8
            glint8 *= glint8
            # Flat areas have no specular light, or the whole image would look hazy.
            gloss = max(glint8 * glint8 * glint8 - flat, 0.0) * shine
            if contour > 0.0:
                phase = here / contour
                nearest = np.round(phase)
                reach = max(0.5 * np.sqrt(across * across + down * down) / contour, 1e-4)
                cover = 1.0 - abs(phase - nearest) / reach
                if cover > 0.0 and abs(nearest) >= 1.0:
                    gain *= 1.0 - 0.75 * cover
                    gloss *= 1.0 - 0.75 * cover
            number = int(min(max((here - low) * per_mm, 0.0), 255.0) + 0.5)
            for k in range(3):
                out[i, j, k] = np.uint8(min(gain * table[number, k] + gloss, 255.0))
