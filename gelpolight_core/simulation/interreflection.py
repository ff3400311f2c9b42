"""Interreflection: light that parts of the membrane send to each other.

A path tracer of the simulation's own; it shares no code with the reconstruction. Paths run between
parts of the surface, directly or by the lower face of the layers, with the LEDs' light and its cast
shadows at each point (:mod:`gelpolight_core.simulation.light_paths`). Indirect light is smooth, so
it is computed at nodes: 0.8 mm apart where nothing is pressed, 0.2 mm near an object, 0.05 mm where
the membrane bends strongly. The random numbers of a node depend on its position only, so a
rendering is repeatable, and the error of the untouched membrane is the same in the background.

The diffuse standard on the bare elastomer is flat and does not light itself directly, but the lower
face returns a part of its light, as it does for the membrane. Both are therefore computed in the
same manner. LED bodies, the housing and the camera reflect nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .light_paths import trace_indirect_light
from .occlusion import sample_all
from .pressed_surface import PressedSurface
from .rays import slopes_to
from .sensor_design import SensorDesign
from .shading import NO_LIGHT, IndirectLight, SurfaceMaterial
from .simulation_kernel import Interrupt, never_interrupt

FINEST_MM = 0.05
_STEPS = (16, 4, 1)
"""Distances between nodes, in finest ones: coarse to fine."""
_PATHS = (1024, 512, 128)
"""Paths for a node of each distance."""
_NEAR_MM = 1.0
_PRESSED_MM = 0.005
"""Nodes are closer within `_NEAR_MM` of membrane that is deeper than this."""
_BENT = 0.25
"""Change of the slope over 0.2 mm above which the closest nodes are used."""
_NODES_AT_ONCE = 16  # takes a few hundredths of a second

FLAT = PressedSurface(np.zeros((2, 2)), np.zeros((2, 2), dtype=np.bool_), 0.0, 0.0, 1.0)


def indirect_light(
    design: SensorDesign,
    lamps: Float64Array,
    surface: PressedSurface,
    factors: tuple[Float64Array, float, float, float],
    material: SurfaceMaterial,
    *,
    interrupt: Interrupt = never_interrupt,
) -> IndirectLight:
    """Return the light that a surface receives from its other parts.

    Parameters
    ----------
    design : SensorDesign
        Its layers, and the number of reflections ``membrane.bounces``.
    lamps : (lamps, 11)
        Lamp table.
    surface : PressedSurface
        The pressed patch; `FLAT` for none.
    factors : (map, first position in mm, pitch in mm, working radius in mm)
        Reflectance factor over the membrane.
    material : SurfaceMaterial
        Material of the surface.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.
    """
    if design.membrane.bounces == 0:
        return NO_LIGHT
    layers = design.layers
    deepest = float(surface.depth_mm.max(initial=0.0))
    scene = (
        (surface.depth_mm, surface.slope_x, surface.slope_y, surface.tile_max),
        (surface.x0_mm, surface.y0_mm, surface.pitch_mm, deepest),
        factors,
        lamps,
        material.values,
        (
            layers.elastomer_thickness_mm,
            layers.elastomer_refractive_index,
            layers.window_thickness_mm,
            layers.window_refractive_index,
        ),
    )

    def light_at(points_mm: Float64Array, numbers: NDArray[np.int64], paths: int) -> Float64Array:
        slopes = slopes_to(layers, points_mm + np.array([*design.membrane.axis_mm, 0.0]))
        nodes = np.column_stack([points_mm[:, :2], slopes])
        out = np.zeros((len(nodes), len(lamps)))
        for start in range(0, len(nodes), _NODES_AT_ONCE):
            interrupt()
            part = slice(start, start + _NODES_AT_ONCE)
            trace_indirect_light(
                out[part], nodes[part], numbers[part], scene, design.membrane.bounces, paths
            )
        return out

    return _on_lattice(surface, rim_mm=factors[3], lamps=len(lamps), light_at=light_at)


def _on_lattice(
    surface: PressedSurface,
    *,
    rim_mm: float,
    lamps: int,
    light_at: Callable[[Float64Array, NDArray[np.int64], int], Float64Array],
) -> IndirectLight:
    """Compute light at nodes as close as they must be, with linear interpolation between them."""
    coarsest = _STEPS[0]
    count = coarsest * (math.ceil(rim_mm / (coarsest * FINEST_MM)) + 1)
    cells = FINEST_MM * np.arange(-count, count + 1, dtype=np.float64)
    x, y = np.meshgrid(cells, cells)
    position = ((x - surface.x0_mm) / surface.pitch_mm, (y - surface.y0_mm) / surface.pitch_mm)
    depth = sample_all(surface.depth_mm, *position)
    pressed = sample_all(np.asarray(surface.depth_mm - surface.rest_mm), *position)
    slopes = [sample_all(slope, *position) for slope in (surface.slope_x, surface.slope_y)]
    in_rim = np.hypot(x, y) <= rim_mm + 1.5 * coarsest * FINEST_MM
    maps = np.zeros((2 * count // coarsest + 1, 2 * count // coarsest + 1, lamps))
    previous = coarsest
    for step, paths, needed in zip(_STEPS, _PATHS, _wanted(pressed, slopes), strict=True):
        maps, previous = _between(maps, previous // step), step
        rows, columns = step * np.argwhere((needed & in_rim)[::step, ::step]).T
        points = np.stack([cells[columns], cells[rows], -depth[rows, columns]], axis=-1)
        numbers = rows * cells.size + columns
        maps[rows // step, columns // step] = light_at(points, numbers, paths)
    return IndirectLight(np.ascontiguousarray(np.moveaxis(maps, -1, 0)), float(cells[0]), FINEST_MM)


def _wanted(pressed: Float64Array, slopes: list[Float64Array]) -> tuple[BoolArray, ...]:
    """Return where nodes of each distance are needed, coarse to fine."""
    near = maximum_filter(pressed, size=2 * round(_NEAR_MM / FINEST_MM) + 1) > _PRESSED_MM
    bends = [maximum_filter(slope, size=5) - minimum_filter(slope, size=5) for slope in slopes]
    return np.ones_like(near), near, near & (np.hypot(*bends) > _BENT)


def _between(maps: Float64Array, parts: int) -> Float64Array:
    """Return (rows, columns, lamps) with `parts` cells in place of one, linear between nodes."""
    if parts == 1:
        return maps
    position = np.arange((len(maps) - 1) * parts + 1) / parts
    i = np.minimum(position.astype(int), len(maps) - 2)
    a = (position - i)[:, None, None]
    rows = maps[i] * (1.0 - a) + maps[i + 1] * a
    a = a[:, 0]
    return np.asarray(rows[:, i] * (1.0 - a) + rows[:, i + 1] * a)
