"""The membrane around an indenter. It follows the indenter in contact, and decays outside.

Outside the contact the membrane is a tense sheet on an elastic foundation,
``decay**2 * laplacian(w) = w``, and it leaves the indenter tangentially.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.drape import (
    ball_contact_from_depth,
    leaving_angle,
    round_drape,
    round_steepness,
)

from .corner_drape import corner_drape, fillet_rounding

FAR_CORNER = 9.0
"""Distance in decay lengths beyond which a corner has no effect: exp(-9) is 1e-4 of the height."""
MOST_STEPS, SETTLED = 30, 1e-6
"""Newton steps to the angle at which the membrane leaves a fillet, and the step that ends them."""


class MembraneRise(NamedTuple):
    """How much the undeformed membrane rises from the place under a face's centre, mm.

    Attributes
    ----------
    here, wall : array or float
        At each point, and at the wall's nearest place to it.
    lean : array or float
        Its slope there, outwards.
    """

    here: Float64Array | float = 0.0
    wall: Float64Array | float = 0.0
    lean: Float64Array | float = 0.0


LEVEL = MembraneRise()
Values = Mapping[str, float]
"""Parameters of a fitted indenter by their names."""


def cylinder_depth(
    radius_mm: Float64Array,
    *,
    cylinder_radius_mm: float,
    height_mm: float,
    decay_mm: float,
    edge_radius_mm: float = 0.0,
    rise: MembraneRise = LEVEL,
) -> Float64Array:
    """Return the membrane's depth around a flat cylinder.

    Parameters
    ----------
    radius_mm : array
        Distances from the cylinder's axis.
    cylinder_radius_mm, height_mm : float
        The cylinder's radius and its indentation depth.
    decay_mm : float
        The drape's decay length: outside, w = h K0(r / decay) / K0(a / decay).
    edge_radius_mm : float, optional
        Fillet between the cylinder's face and its wall.
    rise : MembraneRise, optional
        Rise of the undeformed membrane. Default: a flat one.
    """
    edge = min(edge_radius_mm, cylinder_radius_mm)
    contact_mm, contact_depth = _edge_contact(
        cylinder_radius_mm, height_mm, edge, lambda r: round_steepness(r, decay_mm)
    )

    held = _filleted(radius_mm - cylinder_radius_mm, height_mm, edge)
    if rise is LEVEL:
        free = radius_mm > contact_mm
        held[free] = contact_depth * round_drape(radius_mm[free], contact_mm, decay_mm)
        return held
    steep = round_steepness(contact_mm, decay_mm)
    place, leaving_depth = _contact_on(rise, height_mm, edge, steep)
    drape = round_drape(radius_mm, cylinder_radius_mm + place, decay_mm)
    leaves = radius_mm > cylinder_radius_mm + place
    return np.where(leaves, leaving_depth * drape, held + rise.here)


def wall_depth(
    beyond_mm: Float64Array,
    *,
    height_mm: float,
    decay_mm: float,
    edge_radius_mm: float,
    rise: MembraneRise = LEVEL,
) -> Float64Array:
    """Return the membrane's depth beyond (< 0: inside) a straight wall without ends.

    Parameters
    ----------
    beyond_mm : array
        Distances from the wall.
    height_mm, decay_mm, edge_radius_mm : float
        As in :func:`cylinder_depth`, and so is `rise`.
    """
    place, leaving_depth = _contact_on(rise, height_mm, edge_radius_mm, 1.0 / decay_mm)
    outside = leaving_depth * np.exp(-np.maximum(beyond_mm - place, 0.0) / decay_mm)
    held = _filleted(beyond_mm, height_mm, edge_radius_mm) + rise.here
    return np.where(beyond_mm > place, outside, held)


def cuboid_depth(
    x_mm: Float64Array,
    y_mm: Float64Array,
    *,
    side_mm: tuple[float, float],
    height_mm: float,
    decay_mm: float,
    edge_radius_mm: float = 0.0,
) -> Float64Array:
    """Return the membrane's depth around a flat cuboid whose sides lie along the axes.

    Parameters
    ----------
    x_mm, y_mm : arrays of one shape
        Position relative to the cuboid's centre, along its two sides.
    side_mm : (float, float)
        Sides along x and y.
    height_mm, decay_mm, edge_radius_mm : float
        As in :func:`cylinder_depth`.

    Notes
    -----
    Outside, each edge alone gives exp(-distance / decay), and each corner reduces this according to
    :func:`~gelpolight_core.measurement.corner_drape.corner_drape`. The corners are added as if they
    were independent, which causes an error of about exp(-2 side / decay) of the height.
    """
    half = (side_mm[0] / 2.0, side_mm[1] / 2.0)
    edge = min(edge_radius_mm, *half)
    inset, contact_depth = _edge_contact(0.0, height_mm, edge, lambda _: 1.0 / decay_mm)
    ax, ay = np.abs(x_mm), np.abs(y_mm)
    # Distance to the wall of a box whose edges all carry the fillet; < 0 inside.
    qx, qy = ax - half[0] + edge, ay - half[1] + edge
    beyond = np.hypot(np.maximum(qx, 0.0), np.maximum(qy, 0.0)) - edge
    beyond = np.where((qx <= 0.0) & (qy <= 0.0), np.maximum(qx, qy) - edge, beyond)
    depth = _filleted(beyond, height_mm, edge)
    free = beyond > inset
    depth[free] = contact_depth * _rectangle_drape(
        ax[free] / decay_mm,
        ay[free] / decay_mm,
        [(h + inset) / decay_mm for h in half],
        edge / decay_mm,
        fillet_rounding(edge / decay_mm),
    )
    return depth


def ball_depth(
    radius_mm: Float64Array, *, ball_radius_mm: float, height_mm: float, decay_mm: float
) -> Float64Array:
    """Return the membrane's depth around a ball of radius R pressed to `height_mm`.

    Inside the contact radius the sphere, h - R + sqrt(R**2 - r**2); outside the drape
    K0(r / decay), which meets the sphere without a kink.

    Parameters
    ----------
    radius_mm : array
        Distances from the ball's axis.
    ball_radius_mm, height_mm, decay_mm : float
        The ball's radius, its indentation depth and the drape's decay length.
    """
    contact_mm = ball_contact_from_depth(height_mm, ball_radius_mm, decay_mm=decay_mm)
    inside = height_mm - _sphere_drop(np.minimum(radius_mm, contact_mm), ball_radius_mm)
    free = np.maximum(radius_mm, contact_mm)
    edge_depth = height_mm - _sphere_drop(np.array(contact_mm), ball_radius_mm)
    outside = edge_depth * round_drape(free, contact_mm, decay_mm)
    return np.where(radius_mm > contact_mm, outside, inside)


def cylinder_model_depth(
    values: Values, x_mm: Float64Array, y_mm: Float64Array, rise: MembraneRise = LEVEL
) -> Float64Array:
    """Return the depth (mm) of a cylinder from the parameters of a fit."""
    return cylinder_depth(
        np.hypot(x_mm - values["x_mm"], y_mm - values["y_mm"]),
        cylinder_radius_mm=values["diameter_mm"] / 2.0,
        height_mm=values["height_mm"],
        decay_mm=values["drape_decay_mm"],
        edge_radius_mm=values["edge_radius_mm"],
        rise=rise,
    )


def cuboid_model_depth(values: Values, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the depth (mm) of a cuboid from the parameters of a fit."""
    along, across = turned(x_mm - values["x_mm"], y_mm - values["y_mm"], values["yaw"])
    return cuboid_depth(
        along,
        across,
        side_mm=(values["side_a_mm"], values["side_b_mm"]),
        height_mm=values["height_mm"],
        decay_mm=values["drape_decay_mm"],
        edge_radius_mm=values["edge_radius_mm"],
    )


def ball_model_depth(values: Values, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the depth (mm) of a ball from the parameters of a fit."""
    return ball_depth(
        np.hypot(x_mm - values["x_mm"], y_mm - values["y_mm"]),
        ball_radius_mm=values["diameter_mm"] / 2.0,
        height_mm=values["height_mm"],
        decay_mm=values["drape_decay_mm"],
    )


def turned(x: Float64Array, y: Float64Array, angle: float) -> tuple[Float64Array, Float64Array]:
    """Return coordinates along axes turned by `angle`."""
    cos, sin = np.cos(angle), np.sin(angle)
    return cos * x + sin * y, cos * y - sin * x


def _sphere_drop(radius_mm: Float64Array, ball_radius_mm: float) -> Float64Array:
    """Return how far a sphere lies above its lowest point at a distance from its axis."""
    # This form is accurate for small radii, where R - sqrt(R**2 - r**2) loses digits.
    square = radius_mm**2
    root = np.sqrt(np.maximum(ball_radius_mm**2 - square, 0.0))
    return np.asarray(square / (ball_radius_mm + root))


def _edge_contact(
    face_mm: float, height_mm: float, edge_mm: float, steepness: Callable[[float], float]
) -> tuple[float, float]:
    """Return where on the fillet the membrane leaves (position, depth there).

    `steepness` is -w'/w of the free membrane (1/mm) as a function of the position.
    """
    if edge_mm <= 0.0 or height_mm <= 0.0:
        return face_mm, height_mm

    def excess(angle: float) -> float:
        position = face_mm - edge_mm * (1.0 - math.sin(angle))
        depth = height_mm - edge_mm * (1.0 - math.cos(angle))
        return math.sin(angle) - math.cos(angle) * depth * steepness(position)

    angle = leaving_angle(excess, 0.0)
    return (
        face_mm - edge_mm * (1.0 - math.sin(angle)),
        height_mm - edge_mm * (1.0 - math.cos(angle)),
    )


def _contact_on(
    rise: MembraneRise, height_mm: float, edge_mm: float, steep: float
) -> tuple[Float64Array, Float64Array]:
    """Return the same (from the wall) at each place of the wall in a curved membrane.

    Where the membrane leans away more than its depth holds it, it leaves the face before the
    fillet. That the steepness changes along the fillet matters to second order only.
    """
    height, lean = height_mm + np.asarray(rise.wall), np.asarray(rise.lean)
    angle = np.arctan(np.maximum(height * steep + lean, 0.0))
    for _ in range(MOST_STEPS):
        sin, cos = np.sin(angle), np.cos(angle)
        pull = (height - edge_mm * (lean * (1.0 - sin) + 1.0 - cos)) * steep + lean
        step = (sin - cos * pull) / (cos + sin * pull + cos * edge_mm * (sin - lean * cos) * steep)
        angle = np.clip(angle - step, 0.0, 0.5 * np.pi)
        if not np.any(np.abs(step) > SETTLED):
            break
    place = -edge_mm * (1.0 - np.sin(angle))
    before = -1.0 / steep - height / np.where(lean < 0.0, lean, -np.inf)
    place = np.where((lean < 0.0) & (angle == 0.0), np.minimum(place, before), place)
    return place, height + lean * place - edge_mm * (1.0 - np.cos(angle))


def _filleted(beyond_mm: Float64Array, height_mm: float, edge_mm: float) -> Float64Array:
    """Return the indenter's own surface `beyond_mm` (< 0: inside) its wall."""
    if edge_mm <= 0.0:
        return np.full(beyond_mm.shape, height_mm)
    into = np.clip(beyond_mm + edge_mm, 0.0, edge_mm)
    return np.asarray(height_mm - edge_mm + np.sqrt(np.maximum(edge_mm**2 - into**2, 0.0)))


def _rectangle_drape(
    x: Float64Array, y: Float64Array, half: Sequence[float], edge: float, rounding: float
) -> Float64Array:
    """Return the drape outside rectangles for x, y >= 0, with lengths in decay lengths."""
    dx, dy = x - half[0], y - half[1]
    drape = corner_drape(dx, dy, edge=edge, rounding=rounding)
    # Reduction by the corners at the far ends of the two edges; none beside the edge itself.
    above = (dy > 0.0) & (x + half[0] < FAR_CORNER)
    beside = (dx > 0.0) & (y + half[1] < FAR_CORNER)
    far_x = corner_drape(-x[above] - half[0], dy[above]) - np.exp(-dy[above])
    far_y = corner_drape(dx[beside], -y[beside] - half[1]) - np.exp(-dx[beside])
    drape[above] += far_x
    drape[beside] += far_y
    return np.maximum(drape, 0.0)
