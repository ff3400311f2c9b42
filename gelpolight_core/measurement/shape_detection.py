"""Detect which known indenter is pressed: ball, cylinder, cuboid, or none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.reconstruction.height_map import HeightMap

from .fit_checks import BETTER_SHAPE, POOR_RESIDUAL
from .indenter_fit import residuals_of
from .indenter_models import MODELS
from .segmentation import PressedMap, PressedRegion, find_object, pressed_map


@dataclass(frozen=True, slots=True)
class DetectedShape:
    """The shape of the pressed object, estimated from the depth map.

    Attributes
    ----------
    candidates : tuple of str
        The possible shapes, the best first: one, or the two that fit equally well.
    at_mm : (float, float)
        Where it is, (x, y): the centroid of its upper half.
    """

    candidates: tuple[str, ...]
    at_mm: tuple[float, float]


def detect_shape(
    heightmap: HeightMap,
    *,
    seed_mm: tuple[float, float] | None = None,
    pressed: PressedMap | None = None,
) -> DetectedShape | None:
    """Return the pressed indenter, None if there is none, or another shape.

    All three are fitted with their drape. The best one is returned if its residual is at most 6 %
    of the height and less than three quarters of the next one's. These are the limits at which a
    measurement becomes doubtful.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    seed_mm : (float, float), optional
        A point on the object. Default: the tallest object.
    pressed : PressedMap, optional
        Usable part of the height map, if it is known.

    Raises
    ------
    InputError
        If a seed is given and no object is there.
    """
    pressed = pressed or pressed_map(heightmap)
    regions = pressed.regions
    if not regions or (seed_mm is None and regions[0].cut):
        return None
    seed_mm = seed_mm or _point_on(regions[0], heightmap)
    window = find_object(heightmap, seed_mm, pressed=pressed)
    residual = residuals_of(MODELS, window)
    best, second, _ = sorted(residual, key=lambda shape: residual[shape])
    if residual[best] > POOR_RESIDUAL * window.region.height_mm:
        return None
    alike = residual[best] > BETTER_SHAPE * residual[second]
    return DetectedShape((best, second) if alike else (best,), window.region.centre_mm)


def _point_on(region: PressedRegion, heightmap: HeightMap) -> tuple[float, float]:
    """Return the point of an object's upper half that is nearest to its centroid."""
    rows, columns = np.nonzero(region.core)
    x, y = heightmap.x_mm[columns], heightmap.y_mm[rows]
    nearest = int(np.hypot(x - region.centre_mm[0], y - region.centre_mm[1]).argmin())
    return float(x[nearest]), float(y[nearest])
