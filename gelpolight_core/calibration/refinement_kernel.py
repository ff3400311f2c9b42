"""The model of one ball press in the joint refinement, compiled: a pixel and a light at a time."""

from __future__ import annotations

from math import exp, pi, sqrt

from gelpolight_core.base.compiling import whole
from gelpolight_core.light.membrane_brdf_kernel import LEAST_COSINE, brightness

SHADOW_COSINE = 0.08
"""Below twice this cosine a pixel is in or near a shadow, which is not modelled here."""
CORRELATION = 4.0
"""Errors of the pixels of one ball are correlated (lens, centre, membrane): weights are lower."""

_compiled = whole(error_model="numpy")


@_compiled
def _towards(leds, k, x, y, z):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return unit direction and distance to an LED."""
    lx, ly, lz = leds[k, 0] - x, leds[k, 1] - y, leds[k, 2] - z
    distance = sqrt(lx * lx + ly * ly + lz * lz)
    return (lx / distance, ly / distance, lz / distance), distance


@_compiled
def _bend(bumps, heights, k, cosine):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the logarithm of the curve of channel k at a cosine over Lambert's law."""
    last, total = bumps.shape[0] - 1, 0.0
    position = min(max(0.0, cosine), 1.0) * last  # 0 also for a NaN, which has no place
    below = min(int(position), last - 1)
    share = position - below
    for m in range(bumps.shape[1]):
        total += (bumps[below, m] * (1.0 - share) + bumps[below + 1, m] * share) * heights[k, m]
    return total


@_compiled
def _response(light, normal, towards, k, lobes, heights, bumps, no_curves):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the brightness of channel k per unit of light."""
    value = brightness(light, normal, towards, k, lobes, no_curves)
    if heights.size:
        facing = light[0] * normal[0] + light[1] * normal[1] + light[2] * normal[2]
        cosine = min(max(facing, LEAST_COSINE), 1.0)
        value += (1.0 - lobes[1]) * cosine * (exp(_bend(bumps, heights, k, cosine)) - 1.0) / pi
    return value


@_compiled
def model_press(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    pixels, seen, leds, lobes, heights, bumps, no_curves, reflectance, result
):
    """Write the weighted residuals (N, 3) of a press.

    Parameters
    ----------
    pixels : tuple
        Points and normals of the membrane at rest; directions to the camera, ratio, weight,
        interreflected light in the press and at rest (N, 3).
    seen : tuple
        Points (N, 3), normals (N, 3) and whether they are on the ball (N,).
    leds : (3, 3)
        Positions.
    lobes : tuple
        Exponent, gloss and roughness.
    heights, bumps : (3, M), (nodes, M)
        Heights and terms of the curves. Heights have size 0 for Lambert's law.
    no_curves : (3, 0)
        Diffuse curves of Lambert's law.
    reflectance : float
        Reflectance for interreflected light.
    result : (N, 3)
        Written.
    """
    points, up, view, ratio, weight, around, around_flat = pixels
    surface, normals, _ = seen
    for i in range(points.shape[0]):
        normal = (normals[i, 0], normals[i, 1], normals[i, 2])
        rest = (up[i, 0], up[i, 1], up[i, 2])
        towards = (view[i, 0], view[i, 1], view[i, 2])
        for k in range(3):
            light, far = _towards(leds, k, surface[i, 0], surface[i, 1], surface[i, 2])
            flat, flat_far = _towards(leds, k, points[i, 0], points[i, 1], points[i, 2])
            facing = light[0] * normal[0] + light[1] * normal[1] + light[2] * normal[2]
            direct = _response(light, normal, towards, k, lobes, heights, bumps, no_curves)
            # A solver step may move an LED above the membrane, where it gives no light.
            level = _response(flat, rest, towards, k, lobes, heights, bumps, no_curves)
            direct /= max(level, LEAST_COSINE)
            direct *= light[2] / flat[2] * (flat_far / far) ** 2
            lit = min(max((facing - SHADOW_COSINE) / SHADOW_COSINE, 0.0), 1.0)
            scale = weight[i, k] * lit / CORRELATION
            # The background also contains interreflected light.
            direct /= 1.0 + reflectance * around_flat[i, k]
            more = reflectance * around[i, k] / (1.0 + reflectance * around_flat[i, k])
            result[i, k] = (direct + more - ratio[i, k]) * scale
