"""Light that the membrane around a pressed ball reflects onto itself, for the joint refinement.

The surface is the present estimate of the ball and its drape; the light is computed again when the
estimate improves. It is computed for a membrane that absorbs no light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.ball_pixels import BallPixels, CoarseView
from gelpolight_core.lights.positions import light_directions
from gelpolight_core.parallel import in_parallel
from gelpolight_core.reflectance.ball import BallPose
from gelpolight_core.reflectance.draped_ball import draped_ball
from gelpolight_core.reflectance.gathered_light import (
    Receivers,
    Slab,
    Surface,
    gathered,
    returned_to_flat,
)
from gelpolight_core.reflectance.membrane import Membrane

Array = NDArray[np.float64]


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
    flat, returned = flat_light(view, leds_mm, membrane, slab)
    background = flat + membrane.interreflection * returned

    def lit(pair: tuple[BallPixels, BallPose]) -> BallPixels:
        own, ball = pair
        surface, normals, _ = draped_ball(view.points_mm, view.ray_slope, ball, decay_mm=decay_mm)
        shape = view.reflecting.shape
        field = Surface(
            surface.reshape(*shape, 3),
            normals.reshape(*shape, 3),
            view.view,
            own.field * background,
        )
        points, at, _ = draped_ball(own.points_mm, own.ray_slope, ball, decay_mm=decay_mm)
        place = view.index(own.points_mm)
        nearest = np.clip(np.round(place), 0, np.array(shape) - 1)
        receivers = Receivers(points, at, own.view, nearest)
        found = gathered(field, receivers, leds_mm, membrane, view.pitch_mm, slab=slab)
        level = np.maximum(_at(flat, place), 1e-9)
        return replace(own, around=found / level, around_flat=_at(returned, place) / level)

    return list(in_parallel(lit, list(zip(pixels, balls, strict=True))))


def flat_light(
    view: CoarseView, leds_mm: Array, membrane: Membrane, slab: Slab
) -> tuple[Array, Array]:
    """Return direct light of the flat membrane, and what a lower face returns, (..., 3) each.

    In units of :meth:`Membrane.response` times z / r^3; the membrane absorbs nothing.

    Parameters
    ----------
    view : CoarseView
        The field.
    leds_mm, membrane, slab
        As in :func:`with_light_from_around`.
    """
    shape = view.reflecting.shape
    points = np.concatenate([view.points_mm, np.zeros((len(view.points_mm), 1))], axis=1)
    light, distance = light_directions(leds_mm, points)
    up = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    bright = membrane.response(light, up, view.view.reshape(-1, 3))
    flat = (-bright * light[..., 2] / distance**2).reshape(*shape, 3)
    grid, returned = points.reshape(*shape, 3), np.zeros_like(flat)
    for _ in range(2):
        seen = (flat + membrane.interreflection * returned) * view.reflecting[..., None]
        returned = np.asarray(
            returned_to_flat(seen, grid, view.view, leds_mm, membrane, view.pitch_mm, slab),
            np.float64,
        )
    return flat, returned


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
