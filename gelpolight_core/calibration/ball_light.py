"""Light that the membrane around a pressed ball reflects onto itself, for the joint refinement.

The surface is the present estimate of the ball and its drape; the light is computed again when the
estimate improves. It is computed for a membrane that absorbs no light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from gelpolight_core.arrays import Array
from gelpolight_core.calibration.ball_pixels import BallPixels
from gelpolight_core.parallel import in_parallel
from gelpolight_core.reflectance.ball import BallPose
from gelpolight_core.reflectance.draped_ball import draped_ball
from gelpolight_core.reflectance.gathered_light import (
    Receivers,
    Slab,
    Surface,
    across,
    flat_light,
    gathered,
)
from gelpolight_core.reflectance.membrane import Membrane


def with_light_from_around(
    pixels: Sequence[BallPixels],
    balls: Sequence[BallPose],
    decay_mm: float,
    leds_mm: Array,
    membrane: Membrane,
    slab: Slab,
) -> list[BallPixels]:
    """Return the pixels with the light that they receive from other parts of the membrane.

    Parameters
    ----------
    pixels, balls : sequences of equal length
        Of the presses, and where the balls are.
    decay_mm : float
        Decay length of the drape.
    leds_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        Its lobe and its reflectance, as far as they are known.
    slab : Slab
        What is below the membrane.
    """
    if not pixels:
        return []
    view = pixels[0].view_of_field
    shape = view.reflecting.shape
    points, at_rest = view.points_mm, view.surface
    facets = at_rest.points(points).reshape(*shape, 3)
    up = at_rest.normals(points).reshape(*shape, 3)
    flat, returned = flat_light(
        facets,
        up,
        view.view,
        view.reflecting,
        leds_mm,
        membrane,
        view.pitch_mm,
        slab,
    )
    background = flat + membrane.interreflection * returned

    def lit(pair: tuple[BallPixels, BallPose]) -> BallPixels:
        own, ball = pair
        drape = partial(draped_ball, pose=ball, decay_mm=decay_mm, surface=at_rest)
        surface, normals, _ = drape(points, view.ray_slope)
        field = Surface(
            surface.reshape(*shape, 3),
            normals.reshape(*shape, 3),
            view.view,
            own.field * background,
        )
        if not at_rest.flat:
            field = field._replace(across=across(field.points_mm, view.view, view.pitch_mm))
        places, at, _ = drape(own.points_mm, own.ray_slope)
        place = view.index(own.points_mm)
        nearest = np.clip(np.round(place), 0, np.array(shape) - 1)
        receivers = Receivers(places, at, own.view, nearest)
        found = gathered(field, receivers, leds_mm, membrane, view.pitch_mm, slab=slab)
        level = np.maximum(_at(flat, place), 1e-9)
        return replace(own, around=found / level, around_flat=_at(returned, place) / level)

    return list(in_parallel(lit, list(zip(pixels, balls, strict=True))))


def _at(values: Array, place: Array) -> Array:
    """Return values (rows, columns, 3) between nodes, at rows and columns (N, 2)."""
    row, column = (np.ascontiguousarray(p, np.float32) for p in place.T)
    seen = [
        cv2.remap(
            np.ascontiguousarray(values[..., k], np.float32),
            column[:, None],
            row[:, None],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )[:, 0]
        for k in range(3)
    ]
    return np.stack(seen, axis=-1).astype(np.float64)
