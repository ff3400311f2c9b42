"""The membrane's response to light as compiled functions, one point and one light at a time."""

from __future__ import annotations

from math import pi, sqrt

from gelpolight_core.base.compiling import whole

LEAST_COSINE = 1e-3
LEAST_VIEW = 1e-2

_compiled = whole(error_model="numpy")


@_compiled
def _masking(cosine, a2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return 2.0 * cosine / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine))


@_compiled
def _lobe(light, normal, view, cosine, a2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the GGX lobe times the light's cosine."""
    hx, hy, hz = light[0] + view[0], light[1] + view[1], light[2] + view[2]
    projection = hx * normal[0] + hy * normal[1] + hz * normal[2]
    tilt = min(max(projection / sqrt(hx * hx + hy * hy + hz * hz), 0.0), 1.0)
    cos_view = view[0] * normal[0] + view[1] * normal[1] + view[2] * normal[2]
    cos_view = min(max(cos_view, LEAST_VIEW), 1.0)
    width = tilt * tilt * (a2 - 1.0) + 1.0
    facets = a2 / (pi * width * width)
    return facets * _masking(cosine, a2) * _masking(cos_view, a2) / (4.0 * cos_view)


@_compiled
def _diffuse(cosine, exponent, curves, k):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the diffuse brightness of channel k, times pi."""
    last = curves.shape[1] - 1
    if last < 0:
        return cosine**exponent
    position = cosine * last
    below = min(int(position), last - 1)
    share = position - below
    return curves[k, below] * (1.0 - share) + curves[k, below + 1] * share


@_compiled
def brightness(light, normal, view, k, lobes, curves):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the brightness of channel k per unit of light (0 on the dark side).

    `light`, `normal` and `view` are unit vectors as tuples, `lobes` exponent, gloss and roughness,
    and `curves` (3, nodes) replaces the exponent unless it is empty.
    """
    facing = light[0] * normal[0] + light[1] * normal[1] + light[2] * normal[2]
    if not facing > 0.0:
        return 0.0
    exponent, gloss, roughness = lobes
    cosine = min(max(facing, LEAST_COSINE), 1.0)
    value = (1.0 - gloss) * _diffuse(cosine, exponent, curves, k) / pi
    if gloss != 0.0:
        value += gloss * _lobe(light, normal, view, cosine, roughness * roughness)
    return value


@_compiled
def brightness_of_points(light, normals, view, lobes, curves, result):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the brightness (N, 3) of points under lights (N, 3, 3)."""
    for i in range(light.shape[0]):
        normal = (normals[i, 0], normals[i, 1], normals[i, 2])
        towards = (view[i, 0], view[i, 1], view[i, 2])
        for k in range(3):
            ray = (light[i, k, 0], light[i, k, 1], light[i, k, 2])
            result[i, k] = brightness(ray, normal, towards, k, lobes, curves)
