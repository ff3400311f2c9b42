"""The three indenters as models with parameters, for the fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM, ball_contact_from_depth
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

from .drape import (
    MembraneRise,
    Values,
    ball_model_depth,
    cuboid_model_depth,
    cylinder_model_depth,
    turned,
)
from .segmentation import PressedRegion

TINY_MM = 1e-12
"""Distances below this have no direction."""
SMALLEST_SIZE_MM = 0.1
"""No fitted diameter or side is smaller."""


@dataclass(frozen=True, slots=True)
class IndenterModel:
    """One shape: its parameters and the depth map that they give.

    Attributes
    ----------
    shape : str
        ``cylinder``, ``cuboid`` or ``ball``.
    names : tuple of str
        The parameters beside the baseline.
    depth : callable (values, x_mm, y_mm) -> depth_mm
        The membrane's depth at points of the sensor frame, above the baseline.
    start : callable (region) -> values
        First guess from the segmented bump.
    outline : callable (values) -> (N, 2)
        The contact region's outline, (x, y) in mm.
    corners : callable (values) -> (N, 2)
        Its corners, (x, y) in mm. Their exact shape is not known.
    depth_on : callable (surface, values, x_mm, y_mm) -> depth_mm
        The same as `depth`, pressed along z into a curved membrane.
    """

    shape: str
    names: tuple[str, ...]
    depth: Callable[[Values, Float64Array, Float64Array], Float64Array]
    start: Callable[[PressedRegion], dict[str, float]]
    outline: Callable[[Values], Float64Array]
    corners: Callable[[Values], Float64Array]
    depth_on: Callable[[MembraneShape, Values, Float64Array, Float64Array], Float64Array]

    def on(self, surface: MembraneShape) -> IndenterModel:
        """Return the model on a membrane, itself on a flat one."""
        return self if surface.flat else replace(self, depth=partial(self.depth_on, surface))


def _shared_start(region: PressedRegion) -> dict[str, float]:
    return {
        "x_mm": region.centre_mm[0],
        "y_mm": region.centre_mm[1],
        "height_mm": region.height_mm,
        "drape_decay_mm": TYPICAL_DECAY_MM,
    }


def _sharp(size_mm: float) -> float:
    """Return the indenter's size from the half-height size: the drape falls by half in ln 2."""
    return max(size_mm - 2.0 * TYPICAL_DECAY_MM * float(np.log(2.0)), 0.3 * size_mm)


def _start_cylinder(region: PressedRegion) -> dict[str, float]:
    return _shared_start(region) | {
        "diameter_mm": _sharp(2.0 * float(np.sqrt(region.area_mm2 / np.pi)))
    }


def _start_cuboid(region: PressedRegion) -> dict[str, float]:
    return _shared_start(region) | {
        "side_a_mm": _sharp(region.side_mm[0]),
        "side_b_mm": _sharp(region.side_mm[1]),
        "yaw": region.yaw,
    }


def _no_corners(_: Values) -> Float64Array:
    return np.empty((0, 2))


def _start_ball(region: PressedRegion) -> dict[str, float]:
    start = _shared_start(region)
    half_radius = _sharp(2.0 * float(np.sqrt(region.area_mm2 / np.pi))) / 2.0
    # At about half of its depth, the sphere ends and the drape begins.
    drop = start["height_mm"] / 2.0
    return start | {"diameter_mm": (half_radius**2 + drop**2) / drop}


def _circle(values: Values, radius_mm: float) -> Float64Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    return np.stack(
        [values["x_mm"] + radius_mm * np.cos(angle), values["y_mm"] + radius_mm * np.sin(angle)],
        axis=1,
    )


def _rectangle(values: Values) -> Float64Array:
    a, b = values["side_a_mm"] / 2.0, values["side_b_mm"] / 2.0
    x, y = np.array([[-a, a, a, -a, -a], [-b, -b, b, b, -b]])
    along, across = turned(x, y, -values["yaw"])
    return np.stack([values["x_mm"] + along, values["y_mm"] + across], axis=1)


def _ball_outline(values: Values) -> Float64Array:
    return _circle(
        values,
        ball_contact_from_depth(
            values["height_mm"], values["diameter_mm"] / 2.0, decay_mm=values["drape_decay_mm"]
        ),
    )


def _face_on(
    flat: Callable[[Values, Float64Array, Float64Array, MembraneRise], Float64Array],
    wall: Callable[[Values, Float64Array, Float64Array], tuple[Float64Array, Float64Array]],
    surface: MembraneShape,
    values: Values,
    x_mm: Float64Array,
    y_mm: Float64Array,
) -> Float64Array:
    """Return the depth of a flat face in a curved membrane, of which it stays a plane in space.

    In the contact, it is that in a flat membrane plus the rise of the undeformed one. Outside, the
    membrane leaves each place of the wall as the depth and its lean there demand.
    """
    rim, outwards = wall(values, x_mm, y_mm)
    middle_mm = surface.height(np.array([values["x_mm"], values["y_mm"]]))
    rise = MembraneRise(
        surface.height(np.stack([x_mm, y_mm], axis=-1)) - middle_mm,
        surface.height(rim) - middle_mm,
        (surface.slopes(rim) * outwards).sum(axis=-1),
    )
    return flat(values, x_mm, y_mm, rise)


def _wall_of_circle(
    values: Values, x_mm: Float64Array, y_mm: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the nearest places (..., 2) of the wall, and the directions outwards there."""
    middle = np.array([values["x_mm"], values["y_mm"]])
    offset_mm = np.stack([x_mm, y_mm], axis=-1) - middle
    outwards = offset_mm / np.maximum(np.linalg.norm(offset_mm, axis=-1, keepdims=True), TINY_MM)
    return middle + 0.5 * values["diameter_mm"] * outwards, outwards


def _wall_of_rectangle(
    values: Values, x_mm: Float64Array, y_mm: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the same for four walls."""
    middle = np.array([values["x_mm"], values["y_mm"]])
    half = 0.5 * np.array([values["side_a_mm"], values["side_b_mm"]])
    place = np.stack(turned(x_mm - middle[0], y_mm - middle[1], values["yaw"]), axis=-1)
    nearest = np.clip(place, -half, half)
    # From inside, straight to the wall that is nearest.
    inside = (nearest == place).all(axis=-1, keepdims=True)
    wall_distance = half - np.abs(place)
    straight = (wall_distance <= wall_distance.min(axis=-1, keepdims=True)) * np.where(
        place < 0.0, -1.0, 1.0
    )
    offset_mm = np.where(inside, straight, place - nearest)
    rim = np.where(inside & (straight != 0.0), straight * half, nearest)
    outwards = offset_mm / np.maximum(np.linalg.norm(offset_mm, axis=-1, keepdims=True), TINY_MM)
    rim, outwards = (
        np.stack(turned(v[..., 0], v[..., 1], -values["yaw"]), axis=-1) for v in (rim, outwards)
    )
    return middle + rim, outwards


def _ball_on(
    surface: MembraneShape, values: Values, x_mm: Float64Array, y_mm: Float64Array
) -> Float64Array:
    centre = float(values["x_mm"]), float(values["y_mm"])
    pose = BallPose(centre, float(values["diameter_mm"]) / 2.0, float(values["height_mm"]))
    points = np.stack([x_mm, y_mm], axis=-1)
    upright = points.reshape(-1, 2), np.zeros((x_mm.size, 2))
    membrane, _, _ = draped_ball(*upright, pose, decay_mm=values["drape_decay_mm"], surface=surface)
    return np.asarray(surface.height(points) - membrane[:, 2].reshape(x_mm.shape))


_PLACE = ("x_mm", "y_mm", "height_mm", "drape_decay_mm")
_EDGE = ("edge_radius_mm", "blur_mm2")

MODELS: Mapping[str, IndenterModel] = {
    "cylinder": IndenterModel(
        "cylinder",
        (*_PLACE, "diameter_mm", *_EDGE),
        cylinder_model_depth,
        _start_cylinder,
        lambda values: _circle(values, values["diameter_mm"] / 2.0),
        _no_corners,
        partial(_face_on, cylinder_model_depth, _wall_of_circle),
    ),
    "cuboid": IndenterModel(
        "cuboid",
        (*_PLACE, "side_a_mm", "side_b_mm", "yaw", *_EDGE, "corner_rounding"),
        cuboid_model_depth,
        _start_cuboid,
        _rectangle,
        lambda values: _rectangle(values)[:-1],
        partial(_face_on, cuboid_model_depth, _wall_of_rectangle),
    ),
    "ball": IndenterModel(
        "ball",
        (*_PLACE, "diameter_mm"),
        ball_model_depth,
        _start_ball,
        _ball_outline,
        _no_corners,
        _ball_on,
    ),
}
