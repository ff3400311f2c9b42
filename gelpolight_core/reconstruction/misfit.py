"""How well a reconstructed surface explains its image.

Three brightnesses determine two slopes. The remaining one shows whether the model is
valid. The paper's model solves for a normal of any length (Eq. 10); the misfit is its length minus
1. The normals of the full model have length 1; the misfit is the difference between the measured
image and the image of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.masks import LEAST_LIGHT, SATURATED
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.in_place.calibration import require_open
from gelpolight_core.reconstruction.linear import as_linear
from gelpolight_core.reconstruction.near_light.maps import COARSE, LEAST_SHARE, SensorMaps
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reflectance.gathered_light import Receivers, Surface, gathered, ratio_reflected
from gelpolight_core.reflectance.surroundings import view_directions
from gelpolight_core.sensor_calibration import Calibration, FullModel

Map = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Misfit:
    """Misfit at each node, on a thinned grid.

    Attributes
    ----------
    model : str
        ``paper``: | |n| - 1 |; ``full``: root mean square over the channels of the brightness seen
        less the brightness explained, in units of the flat membrane's.
    values : (rows, columns) float32
        NaN where it is not known.
    """

    model: str
    values: Map


def solve_misfit(
    reconstructor: Reconstructor, frame: NDArray[Any], heightmap: HeightMap, *, largest: int = 200
) -> Misfit:
    """Return how well a height map explains its image.

    Parameters
    ----------
    reconstructor : Reconstructor
        The reconstructor of the height map, of an open sensor.
    frame : (height, width, 3)
        The raw image, as given to :meth:`Reconstructor.depth`.
    heightmap : HeightMap
        With normals for the full model.
    largest : int, optional
        Most nodes per side.

    Raises
    ------
    ValueError
        If normals are needed and missing.
    InputError
        If the sensor is closed: its colours determine no more than the slopes.
    """
    rows, columns = heightmap.depth_mm.shape
    step = max(-(-max(rows, columns) // largest), 1)
    thin = np.s_[step // 2 :: step, step // 2 :: step]
    inside = heightmap.flags[thin] & Flag.OUTSIDE.value == 0
    where = reconstructor.calibration.identity
    calibration = require_open(reconstructor.calibration, where=where)
    full = calibration.full
    if heightmap.model != "full" or full is None:
        left = reconstructor.slopes(frame).length_error[thin]
    elif heightmap.normals is None:
        raise ValueError("the full model's misfit needs the normals")
    else:
        # A node of the thinned grid represents its neighbours, and so does its brightness.
        linear = as_linear(reconstructor.linearise(frame))
        seen = np.asarray(cv2.blur(linear, (step, step)), np.float32)
        light = None if heightmap.health is None else heightmap.health.light
        gain = np.ones(3) if light is None else light.share
        left = _image_misfit(seen, gain, calibration, full, heightmap, thin, inside)
    return Misfit(heightmap.model, np.where(inside, left, np.nan).astype(np.float32))


def _image_misfit(
    rgb: Map,
    gain: Array,
    calibration: Calibration,
    full: FullModel,
    heightmap: HeightMap,
    thin: tuple[slice, slice],
    inside: NDArray[np.bool_],
) -> Map:
    """Return the full model's misfit at the nodes `thin`; 0 where no channel is usable."""
    assert heightmap.normals is not None
    table, depth = calibration.table, heightmap.depth_mm[thin].astype(np.float64)
    ray_slope = table.ray_slope[thin].astype(np.float64)
    x, y = (g[thin].astype(np.float64) for g in np.meshgrid(heightmap.x_mm, heightmap.y_mm))
    # A point of the surface appears where its ray crosses the flat membrane.
    index = [
        (part - offset * depth - first) / heightmap.pitch_mm
        for part, offset, first in (
            (x, ray_slope[..., 0], float(heightmap.x_mm[0])),
            (y, ray_slope[..., 1], float(heightmap.y_mm[0])),
        )
    ]
    column, row = (np.asarray(part, np.float32) for part in index)
    u, v = (cv2.remap(m, column, row, cv2.INTER_LINEAR) for m in (table.u_px, table.v_px))
    raw = np.asarray(cv2.remap(rgb, u, v, cv2.INTER_LINEAR), np.float32)
    base = np.asarray(cv2.remap(full.background, column, row, cv2.INTER_LINEAR), np.float32)
    light = unmix(np.asarray(raw / gain, np.float32), calibration.crosstalk)
    ratio = np.asarray(light / np.maximum(base, LEAST_LIGHT), np.float32)
    of_use = (raw < SATURATED) & (base > LEAST_LIGHT) & inside[..., None]
    pitch = heightmap.pitch_mm * (thin[0].step or 1)
    normals = heightmap.normals[thin].astype(np.float64)
    explained = direct_light(full, np.stack([x, y], axis=-1), depth, normals, ray_slope)
    if full.membrane.interreflection > LEAST_SHARE:
        maps = SensorMaps(calibration, full)
        scale = maps.scale(COARSE)
        at = (np.asarray((m + 0.5) / COARSE - 0.5, np.float32) for m in (column, row))
        sources = (-scale.flat, maps.returned, maps.reflecting[None])
        flat, returned, reflecting = _between(sources, *at)
        points = np.stack([x, y, -depth], axis=-1)
        seen = ratio_reflected(ratio, of_use, reflecting[..., 0]) * flat
        surface = Surface(points, normals, view_directions(ray_slope), seen)
        receivers = Receivers.on(surface, inside)
        leds, membrane, slab = full.led_positions_mm, full.membrane, maps.slab
        found = gathered(surface, receivers, leds, membrane, pitch, slab=slab)
        explained *= 1.0 - returned
        explained[inside] += membrane.interreflection * found / flat[inside]
    left = np.where(of_use, ratio - explained, 0.0)
    count = np.maximum(of_use.sum(axis=-1), 1)
    return np.asarray(np.sqrt((left**2).sum(axis=-1) / count), np.float32)


def _between(maps: tuple[Map, ...], column: Map, row: Map) -> list[Map]:
    """Return maps (planes, rows, columns) between their nodes, (..., planes) each."""
    return [
        np.stack([cv2.remap(plane, column, row, cv2.INTER_LINEAR) for plane in planes], axis=-1)
        for planes in maps
    ]


def direct_light(
    full: FullModel, positions_mm: Array, depth_mm: Array, normals: Array, ray_slope: Array
) -> Array:
    """Return the direct brightness (..., 3) over the flat membrane's (PHYSICS, shading).

    Parameters
    ----------
    full : FullModel
        Lights and membrane.
    positions_mm : (..., 2)
        Position of the surface.
    depth_mm : (...)
        Its depth.
    normals : (..., 3)
        Its unit normals.
    ray_slope : (..., 2)
        Lateral displacement of the ray per mm of depth.
    """
    shape = depth_mm.shape
    there = np.concatenate([positions_mm, -depth_mm[..., None]], axis=-1).reshape(-1, 1, 3)
    flat = np.concatenate(
        [positions_mm - ray_slope * depth_mm[..., None], 0.0 * depth_mm[..., None]], -1
    )
    to_led = full.led_positions_mm - there
    from_flat = full.led_positions_mm - flat.reshape(-1, 1, 3)
    far, far_flat = (np.linalg.norm(a, axis=-1) for a in (to_led, from_flat))
    light, light_flat = to_led / far[..., None], from_flat / far_flat[..., None]
    gain = light[..., 2] / light_flat[..., 2] * (far_flat / far) ** 2
    view = view_directions(ray_slope.reshape(-1, 2))
    level = np.broadcast_to([0.0, 0.0, -1.0], view.shape)
    bright = full.membrane.response(light, normals.reshape(-1, 3), view)
    bright_flat = np.maximum(full.membrane.response(light_flat, level, view), 1e-9)
    return np.asarray((gain * bright / bright_flat).reshape(*shape, 3))
