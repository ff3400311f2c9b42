"""The compiled near-light solve on plain arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.reconstruction.buffers import BufferPool
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.near_light.denoise import denoise_ratio
from gelpolight_core.reconstruction.near_light.grid_resampling import place_rows
from gelpolight_core.reconstruction.near_light.kernel import solve_rows
from gelpolight_core.reconstruction.near_light.kernel_structures import (
    NOT_FINITE,
    GaussNewtonOptions,
    RatioImage,
    slopes_like,
)
from gelpolight_core.reconstruction.near_light.sensor_maps import (
    membrane_numbers,
    node_kinds,
    sensor_scale,
)
from gelpolight_core.sensor.sensor_calibration import FullModel

Map = NDArray[np.float32]
BEST = GaussNewtonOptions(8, 5e-4**2, False)
QUICK = GaussNewtonOptions(4, 3e-3**2, False)


@dataclass(frozen=True, slots=True)
class ShadedField:
    """What one scale of the solve works on, all (rows, columns, ...) on one grid.

    Attributes
    ----------
    ratio, sigma : (rows, columns, 3) float32
        Press over background, and its standard deviation.
    around : (rows, columns, 3) or (rows, columns, 12) float32
        The interreflected light in it: a constant, and its derivative by the normal.
    saturated : (rows, columns, 3) bool
        Channels that are saturated.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    inside : (rows, columns) bool
        Nodes within the seen part of the working circle; where they are not usable, the depth is
        led by what is around.
    ray_slope : (rows, columns, 2) float32
        Sideways move of the ray per mm of depth.
    x_mm, y_mm : (columns,), (rows,) float64
        Nodes.
    """

    ratio: Map
    sigma: Map
    around: Map
    saturated: NDArray[np.bool_]
    usable: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    ray_slope: Map
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RaySlopes:
    """Slopes along the image's rays, as the ray-true integration wants them.

    Attributes
    ----------
    slope_x, slope_y : (rows, columns) float32
        Change of the depth from node to node, per mm.
    normals : (rows, columns, 3) float32
        Unit normals of the surface, z < 0.
    weight : (rows, columns) float32
        How far the slopes are to be trusted, 0..1.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    """

    slope_x: Map
    slope_y: Map
    normals: Map
    weight: Map
    flags: NDArray[np.uint8]


def field_of(
    ratio: NDArray[np.float64],
    ray_slope: NDArray[np.float64],
    x_mm: NDArray[np.float64],
    y_mm: NDArray[np.float64],
    *,
    sigma: float,
    around: float | NDArray[np.float64] = 1.0,
) -> ShadedField:
    """Return a field that is usable everywhere, in single precision."""
    whole = np.ones(ratio.shape[:2], bool)
    single = [np.asarray(a, np.float32) for a in (ratio, np.full_like(ratio, sigma))]
    planes = 12 if np.shape(around)[-1:] == (12,) else 3
    light = np.asarray(np.broadcast_to(around, (*ratio.shape[:2], planes)), np.float32)
    nothing = np.zeros(ratio.shape, bool)
    slope = np.asarray(ray_slope, np.float32)
    return ShadedField(*single, light, nothing, whole, whole, slope, x_mm, y_mm)


def full_model(membrane: MembraneBrdf, leds_mm: NDArray[np.float64]) -> FullModel:
    """Return lights and membrane as a calibration holds them."""
    nothing = np.zeros((1, 1, 3), np.float32)
    return FullModel(leds_mm, 0.0 * leds_mm, membrane, nothing, 0.7, 0.01, "mirror")


def image_of(field: ShadedField) -> RatioImage:
    """Return a field's image as the compiled solve takes it."""
    bad = ~np.isfinite(field.ratio)
    ratio, noise, around = (
        np.ascontiguousarray(np.moveaxis(a, -1, 0), np.float32)
        for a in (np.where(bad, 1.0, field.ratio), field.sigma, field.around)
    )
    if len(around) == 3:
        around = np.concatenate([around, np.zeros((9, *around.shape[1:]), np.float32)])
    marks = ((field.saturated | bad) * np.array([1, 2, 4])).sum(axis=-1).astype(np.uint8)
    marks |= np.where(bad.any(axis=-1), NOT_FINITE, 0).astype(np.uint8)
    return RatioImage(ratio, noise, around, marks)


def solve(
    field: ShadedField,
    depth_mm: Map,
    leds_mm: NDArray[np.float64],
    membrane: MembraneBrdf,
    *,
    steps: GaussNewtonOptions = BEST,
    start: tuple[Map, Map] | None = None,
    workers: int = 1,
    coverage: object = ((-1.0, 2.0),) * 3,
) -> RaySlopes:
    """Solve every node's normal at the present depth."""
    full = full_model(membrane, leds_mm)
    ray_slope = np.moveaxis(field.ray_slope, -1, 0)
    kind = node_kinds(field.usable, field.inside, 1)
    scale = sensor_scale(full, (field.x_mm, field.y_mm), ray_slope, kind, factor=1)
    depth = np.ascontiguousarray(depth_mm, np.float32)
    slopes = slopes_like(depth)
    if start is not None:
        slopes = slopes._replace(normal_x=start[0].copy(), normal_y=start[1].copy())
        steps = steps._replace(warm=True)
    numbers = membrane_numbers(full, coverage)
    RowThreadPool(workers).run(
        len(depth), solve_rows, image_of(field), depth, scale, (0, 0), numbers, steps, slopes
    )
    down = -np.sqrt(np.maximum(1.0 - slopes.normal_x**2 - slopes.normal_y**2, 0.0))
    normals = np.stack([slopes.normal_x, slopes.normal_y, down], axis=-1)
    return RaySlopes(slopes.slope_x, slopes.slope_y, normals, slopes.weight, slopes.flags)


def place_on_grid(
    depth_mm: Map, ray_slope: Map, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]
) -> tuple[Map, Map, NDArray[np.bool_]]:
    """Find the ray that sees each true position: column, row, and whether it is hidden."""
    full = full_model(MembraneBrdf(), np.array([[0.5, 11.8, -13.7], [-10, -5, -13], [10, -6, -13]]))
    kind = np.full(depth_mm.shape, 2, np.uint8)
    scale = sensor_scale(full, (x_mm, y_mm), np.moveaxis(ray_slope, -1, 0), kind, factor=1)
    depth = np.ascontiguousarray(depth_mm, np.float32)
    flags, marks = np.zeros(depth.shape, np.uint8), np.zeros(depth.shape, np.uint8)
    placed, place = np.empty_like(depth), np.empty((2, *depth.shape), np.float32)
    hidden = int(Flag.NOT_OBSERVABLE)
    rows = len(depth)
    place_rows(0, rows, depth, scale, (0, 0), flags, hidden, placed, marks, place)
    return place[0], place[1], marks != 0


def quiet(
    light: Map, background: Map, sigma: Map, usable: NDArray[np.bool_]
) -> tuple[Map, Map, Map | None]:
    """Denoise (rows, columns, 3); also what was left as it is."""
    unknown = np.where(usable[..., None], sigma, np.float32(1e6))
    # The solver knows one noise of press minus background for each channel.
    sd = tuple(np.float32(s) for s in np.median((sigma * background)[usable], axis=0))
    ratio = np.where(usable[..., None], light / background, 1.0)
    planes = [np.ascontiguousarray(np.moveaxis(a, -1, 0), np.float32) for a in (ratio, unknown)]
    nothing = np.zeros((3, 1, 1), np.float32)
    image = RatioImage(planes[0], planes[1], nothing, np.zeros(usable.shape, np.uint8))
    edge = denoise_ratio(image, sd, RowThreadPool(1), BufferPool().take)
    return np.moveaxis(image.ratio, 0, -1), np.moveaxis(image.noise, 0, -1), edge
