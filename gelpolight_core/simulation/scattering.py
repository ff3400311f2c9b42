"""Random directions from which a surface scatters light, for light paths.

A direction is drawn from the diffuse or the metallic component; the weight of the path is divided
by the density of both together.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gelpolight_core.simulation.compiled import compiled
from gelpolight_core.simulation.shading import metallic_lobe, metallic_rise

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
    """Start the sequence of a number; neighbouring numbers give unrelated ones (splitmix64)."""
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
    material : (diffuse, specular, roughness)
        Of the surface.
    u1, u2, choice : float
        Even random numbers in 0..1.
    """
    diffuse, specular, alpha = material
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
    spread = n_h * n_h * (a2 - 1.0) + 1.0
    seen = 2.0 / (1.0 + math.sqrt(1.0 + a2 * (1.0 / (n_v * n_v) - 1.0)))
    facets = a2 / (spread * spread) * seen / (4.0 * n_v)
    reflected = diffuse + specular * metallic_rise(v_h) * lobe
    return lx, ly, lz, reflected * n_l / ((1.0 - glossy) * n_l + glossy * facets)
