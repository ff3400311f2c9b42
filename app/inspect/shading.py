"""Maps as pictures: coloured, shaded, with contour lines. Arrays in, arrays out, no window."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.inspect.look import Light
from gelpolight_core.reconstruction.heightmap import Flag

Map = NDArray[np.float32]
Rgb = NDArray[np.uint8]

AMBIENT = 0.38
SHINE = 46.0
SHININESS = 24
HOLLOW = 1.1
HOLLOW_MM = 0.5


def fitted(values: NDArray[Any], largest_px: int) -> NDArray[Any]:
    """Return a map or picture no larger than so many pixels a side, averaged."""
    rows, columns = values.shape[:2]
    scale = largest_px / max(rows, columns)
    if scale >= 1.0:
        return values
    size = max(round(scale * columns), 2), max(round(scale * rows), 2)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA))


def automatic_range(depth_mm: Map, least_mm: float) -> tuple[float, float]:
    """Return the range of colours for a depth map: from the membrane to what is deepest.

    Negative depths, as beside a press where the gel is pushed out, come in where they count.
    """
    some = depth_mm[::4, ::4]
    low, high = (float(v) for v in np.percentile(some[np.isfinite(some)], (0.5, 99.9)))
    high = max(high, least_mm)
    return (low if low < -0.1 * high else 0.0), high


def coloured(values: Map, table: Rgb, low: float, high: float) -> Rgb:
    """Return a map in the colours of a table (256, 3), RGB."""
    scale = 255.0 / max(high - low, 1e-9)
    above = np.maximum(values - np.float32(low), np.float32(0.0))
    return np.asarray(
        cv2.applyColorMap(cv2.convertScaleAbs(above, alpha=scale), table[:, None]), np.uint8
    )


def slopes(depth_mm: Map, pitch_mm: float) -> tuple[Map, Map]:
    """Return the slopes of a depth map along x and y."""
    scale = 1.0 / (8.0 * pitch_mm)
    along_x = cv2.Sobel(depth_mm, cv2.CV_32F, 1, 0, ksize=3, scale=scale)
    along_y = cv2.Sobel(depth_mm, cv2.CV_32F, 0, 1, ksize=3, scale=scale)
    return np.asarray(along_x), np.asarray(along_y)


def shaded(rgb: Rgb, depth_mm: Map, pitch_mm: float, light: Light, exaggeration: float) -> Rgb:
    """Return a coloured depth map under a lamp, with a gloss, and darker in its hollows.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The colours.
    depth_mm : (rows, columns)
        Up is towards the viewer.
    pitch_mm : float
        Between its pixels.
    light : Light
        The lamp.
    exaggeration : float
        Of depth against width.
    """
    slope_x, slope_y = slopes(depth_mm, pitch_mm / exaggeration)
    to_light = light.direction()
    half_way = to_light + np.array([0.0, 0.0, 1.0])
    half_way /= np.linalg.norm(half_way)
    length = cv2.sqrt(slope_x * slope_x + slope_y * slope_y + np.float32(1.0))
    bright = _dot(slope_x, slope_y, to_light) / length
    side = 2 * max(int(0.5 * HOLLOW_MM / pitch_mm), 1) + 1
    hollow = cv2.subtract(cv2.blur(depth_mm, (side, side)), depth_mm) * np.float32(
        HOLLOW * exaggeration
    )
    lit = AMBIENT + (1.0 - AMBIENT) * np.maximum(bright / to_light[2], 0.0) - np.clip(hollow, 0, 1)
    gain = cv2.convertScaleAbs(np.clip(lit, 0.12, 1.6).astype(np.float32), alpha=128.0)
    result = cv2.multiply(rgb, cv2.merge([gain] * 3), scale=1.0 / 128.0)
    glint = np.maximum(_dot(slope_x, slope_y, half_way) / length, np.float32(0.0))
    # Of flat places no gloss, or all of the picture would be veiled by it.
    base = float(half_way[2]) ** SHININESS
    shine = cv2.convertScaleAbs(np.maximum(cv2.pow(glint, SHININESS) - base, 0.0), alpha=SHINE)
    return np.asarray(cv2.add(result, cv2.merge([shine] * 3)), np.uint8)


def _dot(slope_x: Map, slope_y: Map, direction: NDArray[np.float64]) -> Map:
    x, y, z = (np.float32(v) for v in direction)
    return np.asarray(z - x * slope_x - y * slope_y, np.float32)


def with_contours(rgb: Rgb, depth_mm: Map, step_mm: float) -> Rgb:
    """Draw contour lines at multiples of a depth, one pixel wide; the membrane itself has none."""
    phase = depth_mm / np.float32(step_mm)
    level = np.rint(phase)
    slope_x, slope_y = slopes(np.asarray(phase, np.float32), 1.0)
    reach = np.maximum(cv2.magnitude(slope_x, slope_y), np.float32(1e-4))
    cover = np.clip(1.0 - np.abs(phase - level) / reach, 0.0, 1.0) * (np.abs(level) >= 1.0)
    keep = cv2.convertScaleAbs((1.0 - 0.75 * cover).astype(np.float32), alpha=255.0)
    return np.asarray(cv2.multiply(rgb, cv2.merge([keep] * 3), scale=1.0 / 255.0), np.uint8)


def normal_colours(normals: NDArray[np.float32]) -> Rgb:
    """Return normals as colours: x to red, y to green, how flat it is to blue."""
    scaled = normals * np.array([127.5, 127.5, -127.5], np.float32) + np.float32(127.5)
    return np.asarray(np.clip(scaled, 0.0, 255.0).astype(np.uint8))


def flag_colours(
    rgb: Rgb, flags: NDArray[np.uint8], palette: dict[Flag, tuple[int, int, int]]
) -> Rgb:
    """Return a picture with flagged pixels in the colour of their first flag."""
    table = np.zeros((256, 3), np.uint8)
    for flag, colour in reversed(palette.items()):
        table[(np.arange(256) & flag.value) != 0] = colour
    wanted = sum(flag.value for flag in palette)
    painted = cv2.applyColorMap(flags, table[:, None])
    mask = cv2.bitwise_and(flags, np.full_like(flags, wanted))
    return np.asarray(cv2.copyTo(painted, mask, rgb.copy()), np.uint8)


def outside_filled(rgb: Rgb, outside: NDArray[np.uint8], colour: tuple[int, int, int]) -> Rgb:
    """Return a picture with one colour where nothing is measured; `rgb` may be written on."""
    rgb[outside != 0] = colour
    return rgb
