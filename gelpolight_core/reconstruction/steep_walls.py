"""Integrate a frozen height map again so that steep walls remain steep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gelpolight_core.errors import InputError
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.integration.bilateral import integrate_bilateral
from gelpolight_core.translation import tr

FLAT_MM = 1e-3
MARGIN_MM = 0.5
LEAST_NZ = 0.05


def keep_steep_walls(height_map: HeightMap) -> HeightMap:
    """Return a height map whose depth is integrated from its normals by bilateral weights.

    Least squares deforms the surface beside a wall that is not visible in the image; this method
    separates the surface at the wall. It takes seconds and is intended for frozen images of objects
    with steep walls. On smooth objects, the depth of the height map is more accurate.

    Parameters
    ----------
    height_map : HeightMap
        With normals.

    Raises
    ------
    InputError
        If the height map contains no normals.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> from gelpolight_core.reconstruction.steep_walls import keep_steep_walls
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> height_map = sensor.depth(gp.read_image("session/presses/cylinder_s5_d100.png"))
    >>> keep_steep_walls(height_map).depth_mm.shape == height_map.depth_mm.shape
    True
    """
    if height_map.normals is None:
        raise InputError(
            tr("The height map contains no normals"),
            where=height_map.source or tr("height map"),
            advice=tr("Reconstruct it with normals"),
        )
    valid = (height_map.flags & np.uint8(Flag.OUTSIDE | Flag.INVALID)) == 0
    pressed = valid & (np.abs(height_map.depth_mm) > FLAT_MM)
    if not pressed.any():
        return height_map
    margin = int(np.ceil(MARGIN_MM / height_map.pitch_mm))
    box = tuple(
        slice(max(int(at.min()) - margin, 0), int(at.max()) + margin + 1)
        for at in np.nonzero(pressed)
    )
    normals = height_map.normals[box].astype(np.float64)
    down = np.minimum(normals[..., 2], -LEAST_NZ)
    found = integrate_bilateral(
        normals[..., 0] / down,
        normals[..., 1] / down,
        pitch_mm=height_map.pitch_mm,
        valid=valid[box],
    )
    depth = height_map.depth_mm.copy()
    depth[box] = np.where(valid[box], found.depth_mm, depth[box]).astype(np.float32)
    note = tr("The depth is integrated with bilateral weights, which keep steep walls")
    return replace(height_map, depth_mm=depth, notes=(*height_map.notes, note))
