"""Maps as images: coloured, shaded, with contour lines. Arrays in, arrays out, no window."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.program.display import DisplaySettings
from gelpolight_core.base.arrays import Float32Array, Rgb8Array
from gelpolight_core.base.compiling import whole
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .colour_range import ColourRange
from .colour_tables import SURROUND, colour_table
from .quantities import FLAG_COLOURS

AMBIENT = 0.38
SHINE = 46.0
HOLLOW = 1.1
HOLLOW_MM = 0.5


def shrink_to(values: NDArray[Any], largest_px: int) -> NDArray[Any]:
    """Return a map or image averaged down to a largest number of pixels per side."""
    rows, columns = values.shape[:2]
    # An integer factor: averaging over equal blocks is by far the fastest.
    factor = -(-max(rows, columns) // largest_px)
    if factor <= 1:
        return values
    size = max(round(columns / factor), 2), max(round(rows / factor), 2)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA))


def apply_colour_map(values: Float32Array, table: Rgb8Array, low: float, high: float) -> Rgb8Array:
    """Return a map in the colours of a table (256, 3), RGB."""
    scale = 255.0 / max(high - low, 1e-9)
    above = np.maximum(values - np.float32(low), np.float32(0.0))
    return np.asarray(
        cv2.applyColorMap(cv2.convertScaleAbs(above, alpha=scale), table[:, None]), np.uint8
    )


def slopes(depth_mm: Float32Array, pitch_mm: float) -> tuple[Float32Array, Float32Array]:
    """Return the slopes of a depth map along x and y."""
    scale = 1.0 / (8.0 * pitch_mm)
    along_x = cv2.Sobel(depth_mm, cv2.CV_32F, 1, 0, ksize=3, scale=scale)
    along_y = cv2.Sobel(depth_mm, cv2.CV_32F, 0, 1, ksize=3, scale=scale)
    return np.asarray(along_x), np.asarray(along_y)


def shade_relief(
    depth_mm: Float32Array,
    pitch_mm: float,
    table: Rgb8Array,
    range_mm: tuple[float, float],
    light: tuple[float, float, float],
    *,
    exaggeration: float = 1.0,
    contour_mm: float = 0.0,
) -> Rgb8Array:
    """Return a depth map in colours under a lamp, with specular light and darker hollows.

    Parameters
    ----------
    depth_mm : (rows, columns) float32
        Up is towards the viewer.
    pitch_mm : float
        Pixel pitch.
    table : (256, 3) uint8
        The colours.
    range_mm : (low, high)
        Depths of the first and the last colour.
    light : (x, y, z)
        Unit vector towards the lamp: x right, y down, z out of the surface.
    exaggeration : float, optional
        Scale of depth relative to width.
    contour_mm : float, optional
        Depth between contour lines. 0: none.
    """
    half_way = np.add(light, (0.0, 0.0, 1.0))
    half_way /= np.linalg.norm(half_way)
    side = 2 * max(int(0.5 * HOLLOW_MM / pitch_mm), 1) + 1
    out = np.empty((*depth_mm.shape, 3), np.uint8)
    low, high = range_mm
    shade(
        np.ascontiguousarray(depth_mm, np.float32),
        np.asarray(cv2.blur(depth_mm, (side, side)), np.float32),
        table,
        (low, 255.0 / max(high - low, 1e-9)),
        light,
        tuple(map(float, half_way)),
        (AMBIENT, SHINE, HOLLOW * exaggeration),
        0.5 * exaggeration / pitch_mm,
        float(contour_mm),
        out,
    )
    return out


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
            height = depth[i, j]
            across = depth[i, right] - depth[i, left]
            down = depth[below, j] - depth[above, j]
            slope_x, slope_y = across * steepness, down * steepness
            length = 1.0 / np.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
            bright = (light_z - light_x * slope_x - light_y * slope_y) * length / light_z
            dark = min(max(hollow * (level[i, j] - height), 0.0), 1.0)
            gain = min(max(ambient + (1.0 - ambient) * max(bright, 0.0) - dark, 0.12), 1.6)
            glint = max((half_z - half_x * slope_x - half_y * slope_y) * length, 0.0)
            glint8 = glint * glint
            glint8 *= glint8
            glint8 *= glint8
            # Flat areas have no specular light, or the whole image would look hazy.
            gloss = max(glint8 * glint8 * glint8 - flat, 0.0) * shine
            if contour > 0.0:
                phase = height / contour
                nearest = np.round(phase)
                reach = max(0.5 * np.sqrt(across * across + down * down) / contour, 1e-4)
                cover = 1.0 - abs(phase - nearest) / reach
                if cover > 0.0 and abs(nearest) >= 1.0:
                    gain *= 1.0 - 0.75 * cover
                    gloss *= 1.0 - 0.75 * cover
            number = int(min(max((height - low) * per_mm, 0.0), 255.0) + 0.5)
            for k in range(3):
                out[i, j, k] = np.uint8(min(gain * table[number, k] + gloss, 255.0))


def with_contours(rgb: Rgb8Array, depth_mm: Float32Array, step_mm: float) -> Rgb8Array:
    """Draw contour lines at multiples of a depth, one pixel wide, except at zero depth.

    A step of 0 draws none.
    """
    if step_mm <= 0.0:
        return rgb
    phase = depth_mm / np.float32(step_mm)
    level = np.rint(phase)
    slope_x, slope_y = slopes(np.asarray(phase, np.float32), 1.0)
    reach = np.maximum(cv2.magnitude(slope_x, slope_y), np.float32(1e-4))
    cover = np.clip(1.0 - np.abs(phase - level) / reach, 0.0, 1.0) * (np.abs(level) >= 1.0)
    keep = cv2.convertScaleAbs((1.0 - 0.75 * cover).astype(np.float32), alpha=255.0)
    return np.asarray(cv2.multiply(rgb, cv2.merge([keep] * 3), scale=1.0 / 255.0), np.uint8)


def normal_colours(normals: NDArray[np.float32]) -> Rgb8Array:
    """Return normals as colours: x as red, y as green, flatness as blue."""
    scaled = normals * np.array([127.5, 127.5, -127.5], np.float32) + np.float32(127.5)
    return np.asarray(np.clip(scaled, 0.0, 255.0).astype(np.uint8))


def steepness_deg(normals: NDArray[np.float32]) -> Float32Array:
    """Return the slope of the surface in degrees, from its normals."""
    across = cv2.magnitude(normals[..., 0], normals[..., 1])
    return np.asarray(
        cv2.phase(np.ascontiguousarray(-normals[..., 2]), across, angleInDegrees=True)
    )


def flag_colours(rgb: Rgb8Array, flags: NDArray[np.uint8]) -> Rgb8Array:
    """Return an image with flagged pixels in the colour of their first flag."""
    table = np.zeros((256, 3), np.uint8)
    for flag, colour in reversed(FLAG_COLOURS.items()):
        table[(np.arange(256) & flag.value) != 0] = colour
    any_flag = sum(flag.value for flag in FLAG_COLOURS)
    painted = cv2.applyColorMap(flags, table[:, None])
    mask = cv2.bitwise_and(flags, np.full_like(flags, any_flag))
    return np.asarray(cv2.copyTo(painted, mask, rgb.copy()), np.uint8)


def fill_outside(rgb: Rgb8Array, outside: NDArray[np.uint8]) -> Rgb8Array:
    """Return an image, dark where nothing is measured. `rgb` may be overwritten."""
    return np.asarray(cv2.copyTo(_surround(rgb.shape[:2]), outside, rgb), np.uint8)


@lru_cache(maxsize=4)
def _surround(shape: tuple[int, ...]) -> Rgb8Array:
    return np.full((*shape, 3), SURROUND, np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """A height map in colours, with the range that they stand for.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8
        Colours.
    range_mm : (low, high)
        Depths at the ends of the colours.
    """

    rgb: NDArray[np.uint8]
    range_mm: tuple[float, float]


def map_image(heightmap: HeightMap, display: DisplaySettings) -> MapImage:
    """Return a height map at full detail as colours."""
    depth_mm = heightmap.depth_mm
    range_mm = display.range_mm or ColourRange().update(depth_mm, 0.0)
    draw = relief_image if display.relief else flat_image
    rgb = draw(depth_mm, heightmap.pitch_mm, display, range_mm)
    outside = heightmap.flags & np.uint8(Flag.OUTSIDE)
    return MapImage(fill_outside(rgb, outside), range_mm)


def relief_image(
    depth_mm: Float32Array, pitch_mm: float, display: DisplaySettings, range_mm: tuple[float, float]
) -> Rgb8Array:
    """Return depths in the chosen colours under the chosen lamp, with contour lines."""
    return shade_relief(
        depth_mm,
        pitch_mm,
        colour_table(display.colours),
        range_mm,
        display.light,
        exaggeration=display.exaggeration,
        contour_mm=display.contour_mm,
    )


def flat_image(
    depth_mm: Float32Array,
    _pitch_mm: float,
    display: DisplaySettings,
    range_mm: tuple[float, float],
) -> Rgb8Array:
    """Return depths in the chosen colours without a lamp, with contour lines."""
    rgb = apply_colour_map(depth_mm, colour_table(display.colours), *range_mm)
    return with_contours(rgb, depth_mm, display.contour_mm)


def warm_up() -> None:
    """Compile what the first image would otherwise wait for."""
    flat, display = np.zeros((8, 8), np.float32), DisplaySettings()
    shade_relief(flat, 0.1, colour_table(display.colours), (0.0, 1.0), display.light)
