"""Random light paths between parts of the membrane.

A path starts at a point of the surface and runs against the light. A ray that leaves the surface
towards the camera is reflected by the lower face of the layers. Each point that a path meets adds
the light of the LEDs there, with cast shadows. Its direction is drawn from the diffuse or the
metallic component, and its weight is divided by the density of both together. The elastomer absorbs
light of each LED along the whole path within it; the part within the window passes without loss.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .occlusion import lamp_share, sample, tile_exit
from .pressed_surface import TILE
from .shading import (
    coating_share,
    metallic_lobe,
    metallic_rise,
    passed_share,
    point_brightness,
)
from .simulation_kernel import compiled

_STEP = 0.7
"""Step of the march along a ray in cells: below one, so that no ridge is skipped."""
_START = 0.5
"""Length in cells of the first part of a ray, in which a surface does not meet itself."""
_HALVINGS = 14
_CERTAIN = 3
"""After this number of reflections, a path ends at random."""

# Steps of an evenly spread sequence in three dimensions (Roberts' R3).
_R1, _R2, _R3 = 0.8191725133961645, 0.6710436067037893, 0.5497004779019703

_MOST_PATHS = 1 << 20

_SHIFT_12, _SHIFT_25, _SHIFT_27 = np.uint64(12), np.uint64(25), np.uint64(27)
_SHIFT_11, _SHIFT_30, _SHIFT_31 = np.uint64(11), np.uint64(30), np.uint64(31)
_FACTOR, _GOLDEN = np.uint64(2685821657736338717), np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_UNIT = 1.0 / (1 << 53)


@compiled
def random_number(state: Any) -> float:  # pragma: no cover - compiled
    """Return the next number of a sequence in 0..1 (xorshift64*)."""
    x = state[0]
    x ^= x >> _SHIFT_12
    x ^= x << _SHIFT_25
    x ^= x >> _SHIFT_27
    state[0] = x
    return float((x * _FACTOR) >> _SHIFT_11) * _UNIT


@compiled
def start_random(state: Any, number: int) -> None:  # pragma: no cover - compiled
    """Start the sequence of a number, unrelated to the sequences of its neighbours (splitmix64)."""
    x = (np.uint64(number) + np.uint64(1)) * _GOLDEN
    x = (x ^ (x >> _SHIFT_30)) * _MIX_1
    x = (x ^ (x >> _SHIFT_27)) * _MIX_2
    state[0] = x ^ (x >> _SHIFT_31)


@compiled
def _turned(normal: Any, local: Any) -> Any:  # pragma: no cover - compiled
    """Return a direction given in the frame of a normal (Duff et al. 2017)."""
    nx, ny, nz = normal
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    x, y, z = local
    return (
        x * (1.0 + sign * nx * nx * a) + y * b + z * nx,
        x * sign * b + y * (sign + ny * ny * a) + z * ny,
        -x * sign * nx - y * ny + z * nz,
    )


@compiled
def _facet(n_v: float, alpha: float, u1: float, u2: float) -> Any:  # pragma: no cover - compiled
    """Return the normal of a visible facet, seen from (sqrt(1 - n_v^2), 0, n_v) (Heitz 2018)."""
    across = alpha * math.sqrt(max(0.0, 1.0 - n_v * n_v))
    length = math.hypot(across, n_v)
    vx, vz = across / length, n_v / length
    r, angle = math.sqrt(u1), 2.0 * math.pi * u2
    a, b = r * math.cos(angle), r * math.sin(angle)
    s = 0.5 * (1.0 + vz)
    b = (1.0 - s) * math.sqrt(max(0.0, 1.0 - a * a)) + s * b
    c = math.sqrt(max(0.0, 1.0 - a * a - b * b))
    # The axes across the view are (0, 1, 0) and (-vz, 0, vx).
    x, y, z = alpha * (c * vx - b * vz), alpha * a, max(1e-9, c * vz + b * vx)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@compiled
def scattered(
    normal: Any, view: Any, material: Any, u1: float, u2: float, choice: float
) -> Any:  # pragma: no cover - compiled
    """Return (x, y, z, weight): a direction from which light is scattered towards `view`.

    The weight is reflectance density times cosine over the probability density, so that its mean
    over u1, u2 and choice is the share of even light that the surface scatters towards `view`.

    Parameters
    ----------
    normal, view : (3,)
        Unit vectors.
    material : (diffuse, specular, roughness, ...)
        Material of the surface.
    u1, u2, choice : float
        Even random numbers in 0..1.
    """
    diffuse, specular, alpha = material[0], material[1], material[2]
    n_v = normal[0] * view[0] + normal[1] * view[1] + normal[2] * view[2]
    glossy = specular / (specular + diffuse) if specular > 0.0 and n_v > 1e-6 else 0.0
    if choice < glossy:
        across = math.sqrt(max(1e-24, 1.0 - n_v * n_v))
        hx, hy, hz = _facet(n_v, alpha, u1, u2)
        # In the plane of view and normal, perpendicular to the normal.
        ex = (view[0] - n_v * normal[0]) / across
        ey = (view[1] - n_v * normal[1]) / across
        ez = (view[2] - n_v * normal[2]) / across
        if across <= 1e-9:
            ex, ey, ez = _turned(normal, (1.0, 0.0, 0.0))
        fx = normal[1] * ez - normal[2] * ey
        fy = normal[2] * ex - normal[0] * ez
        fz = normal[0] * ey - normal[1] * ex
        facet = (
            hx * ex + hy * fx + hz * normal[0],
            hx * ey + hy * fy + hz * normal[1],
            hx * ez + hy * fz + hz * normal[2],
        )
        along = 2.0 * (view[0] * facet[0] + view[1] * facet[1] + view[2] * facet[2])
        lx = along * facet[0] - view[0]
        ly = along * facet[1] - view[1]
        lz = along * facet[2] - view[2]
    else:
        r, angle = math.sqrt(u1), 2.0 * math.pi * u2
        local = (r * math.cos(angle), r * math.sin(angle), math.sqrt(max(0.0, 1.0 - u1)))
        lx, ly, lz = _turned(normal, local)
    n_l = normal[0] * lx + normal[1] * ly + normal[2] * lz
    if n_l <= 1e-9:
        return lx, ly, lz, 0.0
    if glossy <= 0.0:
        return lx, ly, lz, diffuse
    hx, hy, hz = lx + view[0], ly + view[1], lz + view[2]
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    if h < 1e-9:
        return lx, ly, lz, 0.0
    v_h = (view[0] * hx + view[1] * hy + view[2] * hz) / h
    n_h = (normal[0] * hx + normal[1] * hy + normal[2] * hz) / h
    lobe = metallic_lobe(n_l, n_v, n_h, v_h, alpha)
    a2 = alpha * alpha
    width = n_h * n_h * (a2 - 1.0) + 1.0
    masking = 2.0 / (1.0 + math.sqrt(1.0 + a2 * (1.0 / (n_v * n_v) - 1.0)))
    facets = a2 / (width * width) * masking / (4.0 * n_v)
    reflected = diffuse + specular * metallic_rise(v_h) * lobe
    return lx, ly, lz, reflected * n_l / ((1.0 - glossy) * n_l + glossy * facets)


@compiled
def membrane_hit(
    depth: Any, tile_max: Any, grid: Any, point: Any, direction: Any, begin: float
) -> Any:  # pragma: no cover - compiled
    """Return (found, x_mm, y_mm, depth_mm): where a ray in the elastomer meets the membrane.

    Parameters
    ----------
    depth, tile_max
        Maps of the :class:`PressedSurface`; outside them the membrane is flat.
    grid : (x0_mm, y0_mm, pitch_mm, deepest_mm)
        Position of the depth map.
    point : (x_mm, y_mm, depth_mm)
        Start.
    direction : (3,)
        Unit vector in the sensor frame; z points away from the camera.
    begin : float
        Length in mm of the first part of the ray that meets nothing.
    """
    x0, y0, pitch, deepest = grid
    sideways = max(math.hypot(direction[0], direction[1]), 1e-9)
    move = (direction[0] / sideways, direction[1] / sideways)
    rise = -direction[2] / sideways * pitch
    cell = ((point[0] - x0) / pitch, (point[1] - y0) / pitch)
    along = begin * sideways / pitch
    if rise < 0.0:
        # Nothing is deeper than the deepest point.
        along = max(along, (deepest - point[2]) / rise)
    rows, columns = tile_max.shape
    before = along
    first = True
    while True:
        d = point[2] + rise * along
        if rise >= 0.0 and d > deepest:
            return False, 0.0, 0.0, 0.0
        x, y = cell[0] + move[0] * along, cell[1] + move[1] * along
        j, i = math.floor(x / TILE), math.floor(y / TILE)
        if not (0 <= i < rows and 0 <= j < columns):
            if rise < 0.0 and d <= 0.0:
                break
            enter = _entrance(x, y, move, columns * TILE, rows * TILE)
            flat = -point[2] / rise if rise < 0.0 else 1e300
            if flat <= along + enter:
                position = _position(grid, cell, move, max(flat, along))
                return True, position[0], position[1], 0.0
            if enter >= 1e299:
                return False, 0.0, 0.0, 0.0
            before, first = along, False
            along += enter
            continue
        leave = tile_exit(x, y, move, i, j)
        if min(d, d + rise * leave) > tile_max[i, j]:
            before, first = along, False
            along += leave
            continue
        if d <= sample(depth, x, y):
            break
        before, first = along, False
        along += min(_STEP, leave) if leave > 1e-3 else leave + 1e-3
    if first:
        # Within a cell of the start: a fold of the surface.
        before = along
    for _ in range(_HALVINGS):
        halfway = 0.5 * (before + along)
        x, y = cell[0] + move[0] * halfway, cell[1] + move[1] * halfway
        if point[2] + rise * halfway <= sample(depth, x, y):
            along = halfway
        else:
            before = halfway
    position = _position(grid, cell, move, along)
    return True, position[0], position[1], max(0.0, point[2] + rise * along)


@compiled
def _position(grid: Any, cell: Any, move: Any, along: float) -> Any:  # pragma: no cover - compiled
    return grid[0] + grid[2] * (cell[0] + move[0] * along), grid[1] + grid[2] * (
        cell[1] + move[1] * along
    )


@compiled
def _entrance(
    x: float, y: float, move: Any, columns: int, rows: int
) -> float:  # pragma: no cover - compiled
    """Return the distance in cells after which a ray from outside a grid enters it."""
    near, far = 0.0, 1e300
    for start, step, size in ((x, move[0], columns), (y, move[1], rows)):
        if abs(step) < 1e-12:
            if not 0.0 <= start < size:
                return 1e300
        else:
            one, two = -start / step, (size - start) / step
            near, far = max(near, min(one, two)), min(far, max(one, two))
    if near >= far:
        return 1e300
    return near + 1e-6


@compiled
def _face(invariant: float, first: float, second: float) -> float:  # pragma: no cover - compiled
    """Return the unpolarised Fresnel reflectance of a face, 1 beyond total reflection."""
    if invariant >= second or invariant >= first:
        return 1.0
    cos_1 = math.sqrt(1.0 - (invariant / first) ** 2)
    cos_2 = math.sqrt(1.0 - (invariant / second) ** 2)
    across = (first * cos_1 - second * cos_2) / (first * cos_1 + second * cos_2)
    along = (first * cos_2 - second * cos_1) / (first * cos_2 + second * cos_1)
    return 0.5 * (across * across + along * along)


@compiled
def _returned(
    point: Any, direction: Any, layers: Any, choice: float
) -> Any:  # pragma: no cover - compiled
    """Return (x_mm, y_mm, share): where a ray comes back to the elastomer's lower face.

    The face itself reflects a little if there is a window; most light comes from the window's other
    face.
    """
    thickness, elastomer, window_mm, window = layers
    sideways = math.hypot(direction[0], direction[1])
    reach = (thickness - point[2]) / -direction[2]
    x, y = point[0] + reach * direction[0], point[1] + reach * direction[1]
    invariant = elastomer * sideways
    if window_mm <= 0.0:
        return x, y, _face(invariant, elastomer, 1.0)
    upper = _face(invariant, elastomer, window)
    if choice < upper:
        return x, y, 1.0
    sine = invariant / window
    further = 2.0 * window_mm / math.sqrt(1.0 - sine * sine) / window * elastomer
    share = _face(invariant, window, 1.0) * (1.0 - upper)
    return x + further * direction[0], y + further * direction[1], share


@compiled
def _next_point(
    surface: Any, grid: Any, layers: Any, point: Any, direction: Any, choice: float
) -> Any:  # pragma: no cover - compiled
    """Return (found, x_mm, y_mm, depth_mm, z of the direction, share, path_mm) where a ray ends.

    The path is its length within the elastomer.
    """
    begin = _START * grid[2]
    hits, x, y, d = membrane_hit(surface[0], surface[3], grid, point, direction, begin)
    if hits or direction[2] > -1e-9:
        path_mm = math.sqrt((x - point[0]) ** 2 + (y - point[1]) ** 2 + (d - point[2]) ** 2)
        return hits, x, y, d, direction[2], 1.0, path_mm
    x, y, share = _returned(point, direction, layers, choice)
    if share <= 0.0:
        return False, x, y, 0.0, direction[2], 0.0, 0.0
    upward = (direction[0], direction[1], -direction[2])
    hits, x, y, d = membrane_hit(surface[0], surface[3], grid, (x, y, layers[0]), upward, 0.0)
    path_mm = (2.0 * layers[0] - point[2] - d) / upward[2]
    return hits, x, y, d, upward[2], share, path_mm


@compiled
def _normal(surface: Any, grid: Any, x: float, y: float) -> Any:  # pragma: no cover - compiled
    cell = ((x - grid[0]) / grid[2], (y - grid[1]) / grid[2])
    gx, gy = sample(surface[1], cell[0], cell[1]), sample(surface[2], cell[0], cell[1])
    length = math.sqrt(1.0 + gx * gx + gy * gy)
    return -gx / length, -gy / length, -1.0 / length


@compiled
def _add_path(
    value: Any, start: Any, scene: Any, bounces: int, numbers: Any, state: Any
) -> None:  # pragma: no cover - compiled
    """Add the light of one path to `value` (lamps,)."""
    surface, grid, factor, lamps, material, layers = scene
    factors, factor_x0, factor_pitch, rim = factor
    point, normal, view = start
    weight, travelled_mm = 1.0, 0.0
    for bounce in range(bounces):
        if bounce > 0:
            numbers = (random_number(state), random_number(state), random_number(state))
        lx, ly, lz, share = scattered(normal, view, material, numbers[0], numbers[1], numbers[2])
        weight *= share
        if weight <= 0.0:
            return
        hits, x, y, d, lz, share, path_mm = _next_point(
            surface, grid, layers, point, (lx, ly, lz), random_number(state)
        )
        if not hits or x * x + y * y > rim * rim:
            return
        point, normal, view = (x, y, d), _normal(surface, grid, x, y), (-lx, -ly, -lz)
        if normal[0] * view[0] + normal[1] * view[1] + normal[2] * view[2] <= 0.0:
            return
        travelled_mm += path_mm
        weight *= share * sample(
            factors, (x - factor_x0) / factor_pitch, (y - factor_x0) / factor_pitch
        )
        weight *= coating_share(point, normal, material)
        for k in range(lamps.shape[0]):
            bright = point_brightness(point, normal, view, lamps[k], material)
            if bright > 0.0:
                bright *= passed_share(lamps[k], travelled_mm)
                value[k] += (
                    weight * bright * lamp_share(surface[0], surface[3], grid, point, lamps[k])
                )
        if bounce + 1 >= _CERTAIN:
            going_on = min(0.95, weight)
            if random_number(state) >= going_on:
                return
            weight /= going_on


@compiled
def trace_indirect_light(
    out: Any, nodes: Any, numbers: Any, scene: Any, bounces: int, samples: int
) -> None:  # pragma: no cover - compiled
    """Write the light (nodes, lamps) that nodes receive from other parts of the surface.

    Parameters
    ----------
    out : (nodes, lamps)
        Brightness towards the camera at a reflectance factor of 1.
    nodes : (nodes, 4)
        x_mm, y_mm and the slopes of the camera's ray.
    numbers : (nodes,)
        Number of each node's random sequence.
    scene : (surface, grid, factor, lamps (lamps, 11), material, layers)
        As for the pixels; layers: elastomer's thickness and index, window's thickness and index.
    bounces : int
        Largest number of reflections before a node.
    samples : int
        Paths for a node.
    """
    surface, grid = scene[0], scene[1]
    state = np.zeros(1, np.uint64)
    value = np.zeros(out.shape[1])
    for number in range(nodes.shape[0]):
        x, y, sx, sy = nodes[number, 0], nodes[number, 1], nodes[number, 2], nodes[number, 3]
        start_random(state, numbers[number] * _MOST_PATHS)
        d = sample(surface[0], (x - grid[0]) / grid[2], (y - grid[1]) / grid[2])
        length = math.sqrt(1.0 + sx * sx + sy * sy)
        start = (
            (x, y, d),
            _normal(surface, grid, x, y),
            (-sx / length, -sy / length, -1.0 / length),
        )
        r1, r2, r3 = random_number(state), random_number(state), random_number(state)
        value[:] = 0.0
        for path in range(samples):
            # A path does not depend on the length of the paths before it.
            start_random(state, numbers[number] * _MOST_PATHS + path + 1)
            numbers_at = (
                (r1 + path * _R1) % 1.0,
                (r2 + path * _R2) % 1.0,
                (r3 + path * _R3) % 1.0,
            )
            _add_path(value, start, scene, bounces, numbers_at, state)
        for k in range(out.shape[1]):
            out[number, k] = value[k] / samples
