"""Find the pressed objects of a depth map, without knowledge of their shape."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .map_slopes import slopes_of

NOISE_FACTOR = 8.0
"""Least height of a press as a multiple of the ground's scatter. With 5 sigma, one pixel of 1e6
would exceed the limit; a map has 1e6 pixels, and its offsets are not Gaussian."""
SMALLEST_AREA_MM2 = 0.2
"""Bumps with a smaller half-height area are ignored: a pin of 0.5 mm diameter."""
SECONDARY_SHARE = 0.25
"""Bumps lower than this share of the tallest are ripples of the reconstruction, not objects."""
MARGIN_MM = 3.0
"""Width of the ground around the half-height outline that is fitted: four decay lengths of 0.7
mm."""
OTHER_REACH_MM = 2.5
"""How far the drape of another object reaches into the ground around this one."""
DRAPE_MM = 1.5
"""Where the drape falls to a tenth of the height, about two decay lengths."""
SEED_REACH_MM = 1.0
"""How far beside an object's half-height outline a seed point may lie."""


@dataclass(frozen=True, slots=True)
class PressedRegion:
    """One bump of the depth map.

    Attributes
    ----------
    core : (rows, columns) bool
        Where the depth is above half the bump's height.
    height_mm : float
        Robust top height above the ground.
    centre_mm : (float, float)
        Centroid of `core`, (x, y).
    area_mm2 : float
        Area of `core`.
    side_mm : (float, float)
        Sides of the smallest rectangle around `core`; the first lies along `yaw`.
    yaw : float
        Angle of the first side to the x axis, radians, in [-pi/4, pi/4].
    cut : bool
        Whether `core` touches the border of the valid map.
    """

    core: BoolArray
    height_mm: float
    centre_mm: tuple[float, float]
    area_mm2: float
    side_mm: tuple[float, float]
    yaw: float
    cut: bool


@dataclass(frozen=True, slots=True)
class PressedMap:
    """The usable part of a height map, with its pressed regions.

    Attributes
    ----------
    x_mm, y_mm : (columns,), (rows,)
        The grid.
    depth_mm, weight : (rows, columns)
        Depth, 0 where it is not usable, and its weight in [0, 1].
    regions : list of PressedRegion
        The bumps, tallest first.
    """

    x_mm: Float64Array
    y_mm: Float64Array
    depth_mm: Float64Array
    weight: Float64Array
    regions: list[PressedRegion]


@dataclass(frozen=True, slots=True)
class FitWindow:
    """The part of a height map that one object is measured on.

    Attributes
    ----------
    heightmap : HeightMap
        The whole map, with its noise and the membrane at rest.
    region : PressedRegion
        The object's bump.
    x_mm, y_mm, depth_mm, weight : (rows, columns)
        Position, depth, and weight (1: an ordinary pixel, 0: not to be used).
    near_wall : (rows, columns) bool
        Where the wall is expected.
    pitch_mm : float
        Distance of pixels.
    seen_share : float
        Share of the first 1.5 mm of the drape that is on the map.
    slopes : (2, rows, columns)
        Slopes along x and y.
    known : (rows, columns) bool
        Where they are known.
    ground : (rows, columns) bool
        What lies beyond the wall.
    other_mm : (float, float) or None
        Another bump (x, y) that the border cuts, where the object was not chosen by a point.
    """

    heightmap: HeightMap
    region: PressedRegion
    x_mm: Float64Array
    y_mm: Float64Array
    depth_mm: Float64Array
    weight: Float64Array
    near_wall: BoolArray
    pitch_mm: float
    seen_share: float
    slopes: Float64Array
    known: BoolArray
    ground: BoolArray
    other_mm: tuple[float, float] | None = None


def ground_level_mm(depth_mm: Float64Array, valid: BoolArray) -> tuple[float, float]:
    """Return level and scatter (1 sigma) of the untouched membrane.

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth map.
    valid : (rows, columns) bool
        Where it may be used.
    """
    values = depth_mm[valid]
    middle, lowest, extent = np.median(values), values.min(), np.ptp(values)
    low = values[values <= middle + 0.2 * extent]
    level = float(np.median(low))
    if middle > lowest + 0.05 * extent:
        # An object and its drape can cover most of the map: the ground is the most frequent depth.
        low = np.sort(values)[: max(values.size // 2, 1)]
        half = max(low.size // 2, 1)
        start = int(np.argmin(low[half - 1 :] - low[: low.size - half + 1]))
        level = float(np.median(low[start : start + half]))
    # The drape only raises the ground, so the scatter is computed from values below the level.
    below = level - low[low <= level]
    return level, robust_sd(below) if below.size else 0.0


def find_pressed_regions(
    depth_mm: Float64Array, x_mm: Float64Array, y_mm: Float64Array, valid: BoolArray
) -> list[PressedRegion]:
    """Return the bumps of a depth map, tallest first.

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth, positive towards the camera; finite.
    x_mm, y_mm : (columns,), (rows,)
        The map's regular grid.
    valid : (rows, columns) bool
        Where the map may be used.
    """
    pitch = _pitch_mm(x_mm, y_mm)
    # Smoothing over a tenth of a millimetre removes pixel noise, but no object.
    smooth = _smoothed_over_gaps(depth_mm, valid, 0.1 / pitch)
    level, scatter = ground_level_mm(smooth, valid)
    # Missing pixels within the map are gaps, not its border.
    valid = ndimage.binary_fill_holes(valid)
    lift = np.where(valid, smooth - level, 0.0)
    peak = float(lift.max())
    min_height = NOISE_FACTOR * scatter
    if peak <= max(min_height, 1e-6):
        return []
    threshold = max(min_height, 0.5 * SECONDARY_SHARE * peak)
    inner = ndimage.binary_erosion(valid, border_value=0)
    regions = [
        region
        for core in _half_height_cores(lift, threshold, SMALLEST_AREA_MM2 / pitch**2)
        if (region := _describe(core, lift, x_mm, y_mm, inner)).height_mm > min_height
    ]
    return sorted(regions, key=lambda r: -r.height_mm)


def _smoothed_over_gaps(depth_mm: Float64Array, valid: BoolArray, sigma_px: float) -> Float64Array:
    """Return the map smoothed by a Gaussian that leaves out what is not valid."""
    side = 2 * int(4.0 * sigma_px + 0.5) + 1
    share, total = (
        cv2.GaussianBlur(values, (side, side), sigma_px, borderType=cv2.BORDER_REFLECT)
        for values in (valid.astype(np.float64), np.where(valid, depth_mm, 0.0))
    )
    return np.asarray(np.divide(total, share, out=np.zeros_like(total), where=share > 1e-6))


def _half_height_cores(
    lift: Float64Array, threshold: float, least_pixels: float
) -> list[BoolArray]:
    """Return the half-height area of every bump. Bumps joined by their drapes are separated."""
    labels, count = ndimage.label(lift > threshold)
    cores: list[BoolArray] = []
    for label in range(1, count + 1):
        island = labels == label
        if island.sum() < least_pixels:
            continue
        top = float(np.quantile(lift[island], 0.98))
        parts, part_count = ndimage.label(island & (lift > 0.5 * top))
        for part in range(1, part_count + 1):
            core = parts == part
            if core.sum() >= least_pixels:
                cores.append(core)
    return cores


def _describe(
    core: BoolArray, lift: Float64Array, x_mm: Float64Array, y_mm: Float64Array, inner: BoolArray
) -> PressedRegion:
    pitch = _pitch_mm(x_mm, y_mm)
    rows, columns = np.nonzero(core)
    points = np.stack([x_mm[columns], y_mm[rows]], axis=1)
    (_, _), (width, height), angle = cv2.minAreaRect(points.astype(np.float32))
    yaw = np.deg2rad(angle)
    side = (width + pitch, height + pitch)
    quarter_turns = round(yaw / (np.pi / 2.0))
    if quarter_turns % 2:
        side = side[::-1]
    return PressedRegion(
        core=core,
        height_mm=float(np.quantile(lift[core], 0.8)),
        centre_mm=(float(points[:, 0].mean()), float(points[:, 1].mean())),
        area_mm2=float(core.sum()) * pitch**2,
        side_mm=side,
        yaw=float(yaw - quarter_turns * np.pi / 2.0),
        cut=bool((core & ~inner).any()),
    )


def _pitch_mm(x_mm: Float64Array, y_mm: Float64Array) -> float:
    return float(np.sqrt(abs(x_mm[1] - x_mm[0]) * abs(y_mm[1] - y_mm[0])))


def pressed_map(heightmap: HeightMap) -> PressedMap:
    """Return the usable part of a height map, with its pressed regions."""
    x, y = (np.asarray(axis, np.float64) for axis in (heightmap.x_mm, heightmap.y_mm))
    outside = (heightmap.flags & np.uint8(Flag.OUTSIDE)) != 0
    # A flagged pixel has an error about three times that of its neighbours.
    weight = np.where(heightmap.flags != 0, 0.1, 1.0)
    weight[outside | ~np.isfinite(heightmap.depth_mm)] = 0.0
    depth = np.where(weight > 0.0, heightmap.depth_mm.astype(np.float64), 0.0)
    regions = find_pressed_regions(depth, x, y, weight > 0.0) if weight.any() else []
    return PressedMap(x, y, depth, weight, regions)


def find_object(
    heightmap: HeightMap,
    seed_mm: tuple[float, float] | None = None,
    *,
    pressed: PressedMap | None = None,
) -> FitWindow:
    """Return an object with the ground around it.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    seed_mm : (float, float), optional
        A point on the object (x, y); needed where several objects are pressed.
    pressed : PressedMap, optional
        Usable part of the map, if it is known.

    Raises
    ------
    InputError
        Nothing pressed, several objects and no seed, no object at the seed, or an object cut by the
        border.
    """
    pressed = pressed or pressed_map(heightmap)
    weight = pressed.weight
    if min(weight.shape) < 8 or not weight.any():
        raise InputError("no pixel is usable", "depth map", "Check the image and the working area")
    if not pressed.regions:
        raise InputError("no object is pressed", "depth map", Remedy.PRESS_DEEPER)
    other_mm = None
    if seed_mm is None:
        region, other_mm = _only_region(pressed.regions)
    else:
        region = _region_at(pressed, seed_mm)
    if region.cut:
        text = (
            f"the object at ({region.centre_mm[0]:.1f}, {region.centre_mm[1]:.1f}) "
            "mm is cut by the border of the map"
        )
        raise InputError(text, "depth map", Remedy.PRESS_MIDDLE)
    pitch_mm = _pitch_mm(pressed.x_mm, pressed.y_mm)
    margin = int(np.ceil(MARGIN_MM / pitch_mm))
    rows, columns = np.nonzero(region.core)
    window = (
        slice(max(rows.min() - margin, 0), rows.max() + margin + 1),
        slice(max(columns.min() - margin, 0), columns.max() + margin + 1),
    )
    core, weight, depth_mm = region.core[window], weight[window], pressed.depth_mm[window]
    core_distance_mm = ndimage.distance_transform_edt(~core) * pitch_mm
    seen_share = _seen_share(core, weight, core_distance_mm, pitch_mm)
    weight = np.where(core_distance_mm <= MARGIN_MM, weight, 0.0)
    others = np.zeros(core.shape, dtype=bool)
    for other in pressed.regions:
        if other is not region:
            others |= other.core[window]
    if others.any():
        distance_mm = ndimage.distance_transform_edt(~others) * pitch_mm
        nearer = (distance_mm < OTHER_REACH_MM) & (distance_mm < core_distance_mm)
        weight = np.where(nearer, 0.0, weight)
    inside_mm = ndimage.distance_transform_edt(core) * pitch_mm
    near_wall = (inside_mm < 1.2) & (core_distance_mm < 0.4)
    *slopes, known = slopes_of(heightmap, window)
    grid = np.meshgrid(pressed.x_mm[window[1]], pressed.y_mm[window[0]])
    return FitWindow(
        heightmap,
        region,
        *grid,
        depth_mm,
        weight,
        near_wall,
        pitch_mm,
        seen_share,
        np.stack(slopes),
        known,
        ~core & ~near_wall,
        other_mm,
    )


def _only_region(
    regions: list[PressedRegion],
) -> tuple[PressedRegion, tuple[float, float] | None]:
    """Return the only object, or the deepest beside others that the border cuts.

    The second value is the place of the deepest of these.
    """
    tall = [r for r in regions if r.height_mm > SECONDARY_SHARE * regions[0].height_mm]
    others = tall[1:]
    if others and (tall[0].cut or not all(r.cut for r in others)):
        places = ", ".join(f"({r.centre_mm[0]:.1f}, {r.centre_mm[1]:.1f})" for r in tall)
        text = f"{len(tall)} objects are pressed, at {places} mm"
        raise InputError(text, "depth map", Remedy.CHOOSE_OBJECT)
    return tall[0], others[0].centre_mm if others else None


def _region_at(pressed: PressedMap, seed_mm: tuple[float, float]) -> PressedRegion:
    def distance_mm(region: PressedRegion) -> float:
        rows, columns = np.nonzero(region.core)
        dx, dy = pressed.x_mm[columns] - seed_mm[0], pressed.y_mm[rows] - seed_mm[1]
        return float(np.hypot(dx, dy).min())

    nearest = min(pressed.regions, key=distance_mm)
    if not distance_mm(nearest) <= SEED_REACH_MM:
        text = (
            f"no object lies at ({seed_mm[0]:g}, {seed_mm[1]:g}) mm; the nearest is at "
            f"({nearest.centre_mm[0]:.1f}, {nearest.centre_mm[1]:.1f}) mm"
        )
        raise InputError(text, "seed", Remedy.CHOOSE_OBJECT)
    return nearest


def _seen_share(
    core: BoolArray, weight: Float64Array, core_distance_mm: Float64Array, pitch_mm: float
) -> float:
    """Return which share of the ground within 1.5 mm of the half-height outline is usable."""
    border = int(np.ceil(DRAPE_MM / pitch_mm)) + 1
    # With padding, so that ground beyond the map's edge counts as missing.
    rows, columns = np.nonzero(core)
    part = core[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    padded_mm = ndimage.distance_transform_edt(~np.pad(part, border)) * pitch_mm
    usable = (core_distance_mm > 0.0) & (core_distance_mm < DRAPE_MM) & (weight > 0.0)
    whole = (padded_mm > 0.0) & (padded_mm < DRAPE_MM)
    return float(usable.sum() / max(int(whole.sum()), 1))
