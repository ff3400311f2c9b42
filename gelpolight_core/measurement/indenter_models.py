"""The three indenters as models with parameters, for the fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM, ball_contact_from_depth
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

from .drape import (
    LEVEL,
    MembraneRise,
    Values,
    ball_model_depth,
    cuboid_model_depth,
    cylinder_model_depth,
    turned,
    wall_depth,
)
from .segmentation import PressedRegion

TINY_MM = 1e-12
"""Distances below this have no direction."""
LINES, WALL_LINES = 24, 7
"""Lines around a round indenter, and across each wall of a cuboid, on a curved membrane."""
SMALLEST_SIZE_MM = 0.1
"""No fitted diameter or side is smaller."""


class WallPlaces(NamedTuple):
    """Where points lie relative to a wall.

    Attributes
    ----------
    beyond_mm : (n,)
        Distance beyond the wall, < 0 inside.
    outwards : (2, n)
        Direction in which it grows.
    turning : (n,) or float
        By how much this direction turns per mm along the wall, 1/mm.
    row, rows_per_mm : (n,)
        Place along the wall, in lines of `IndenterModel.line` on a curved membrane, and its change
        towards (-y, x) of `outwards`.
    walls : dict
        For each size (a diameter or side), which points belong to its walls: 1 or 0.
    """

    beyond_mm: Float64Array
    outwards: Float64Array
    turning: Float64Array | float
    row: Float64Array
    rows_per_mm: Float64Array
    walls: Mapping[str, Float64Array | float]


@dataclass(frozen=True, slots=True)
class IndenterModel:
    """One shape: its parameters, the depth map that they give, and its wall.

    Without its corners, a wall gives slopes across it only, so that they are known from the depth
    on a line; on a curved membrane from several.

    Attributes
    ----------
    shape : str
        ``cylinder``, ``cuboid`` or ``ball``.
    names : tuple of str
        The parameters beside the baseline.
    flat_depth : callable (values, x_mm, y_mm) -> depth_mm
        The depth of a flat membrane at points of the sensor frame, above the baseline.
    start : callable (region) -> values
        First guess from the segmented bump.
    outline : callable (values) -> (N, 2)
        The contact region's outline, (x, y) in mm.
    corners : callable (values) -> (N, 2)
        Its corners, (x, y) in mm. Their exact shape is not known.
    across : callable (values, beyond_mm, rise) -> depth_mm
        The depth beyond (< 0: inside) a wall without corners.
    lines : callable (values) -> (rows, 2), (rows, 2)
        Places on the wall all around, and the directions outwards.
    places : callable (values, x_mm, y_mm) -> WallPlaces
        Where points lie relative to the wall.
    surface : MembraneShape
        The undeformed membrane.
    curved_depth : callable (surface, values, points_mm (..., 2)) -> depth_mm, optional
        The depth in a curved membrane, if it does not follow from `across`.
    """

    shape: str
    names: tuple[str, ...]
    flat_depth: Callable[[Values, Float64Array, Float64Array], Float64Array]
    start: Callable[[PressedRegion], dict[str, float]]
    outline: Callable[[Values], Float64Array]
    corners: Callable[[Values], Float64Array]
    across: Callable[[Values, Float64Array, MembraneRise], Float64Array]
    lines: Callable[[Values], tuple[Float64Array, Float64Array]]
    places: Callable[[Values, Float64Array, Float64Array], WallPlaces]
    surface: MembraneShape = FLAT
    curved_depth: Callable[[MembraneShape, Values, Float64Array], Float64Array] | None = None

    @property
    def flat(self) -> bool:
        """Whether the membrane is flat."""
        return self.surface.flat

    def on(self, surface: MembraneShape) -> IndenterModel:
        """Return the model on a membrane, pressed along z."""
        return replace(self, surface=surface)

    def depth(self, values: Values, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return the membrane's depth at points of the sensor frame, above the baseline."""
        if self.flat:
            return self.flat_depth(values, x_mm, y_mm)
        points = np.stack([x_mm, y_mm], axis=-1)
        if self.curved_depth is not None:
            return self.curved_depth(self.surface, values, points)
        rim, places = self._rims(values, x_mm, y_mm)
        rise = self._rise(values, points, rim, np.moveaxis(places.outwards, 0, -1))
        return self.across(values, places.beyond_mm, rise) + self.by_corners(values, x_mm, y_mm)

    def by_corners(self, values: Values, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return what corners add to the depth, in proportion to that at the wall."""
        if not len(self.corners(values)):
            return np.zeros(x_mm.shape)
        rim, places = self._rims(values, x_mm, y_mm)
        added = self.flat_depth(values, x_mm, y_mm) - self.across(values, places.beyond_mm, LEVEL)
        if self.flat:
            return added
        wall = np.zeros(x_mm.shape)
        rise = self._rise(values, rim, rim, np.moveaxis(places.outwards, 0, -1))
        at_wall = self.across(values, wall, rise), self.across(values, wall, LEVEL)
        return np.asarray(added * at_wall[0] / at_wall[1])

    def line(self, values: Values, beyond_mm: Float64Array) -> Float64Array:
        """Return the depth (rows, n) on lines across the wall; on a flat membrane on one.

        Parameters
        ----------
        values : mapping
            The parameters.
        beyond_mm : (n,)
            Distances beyond the wall, < 0 inside.
        """
        if self.flat:
            return self.across(values, beyond_mm[None], LEVEL)
        rim, outwards = (part[:, None] for part in self.lines(values))
        points = rim + beyond_mm[:, None] * outwards
        if self.curved_depth is not None:
            return self.curved_depth(self.surface, values, points)
        return self.across(values, beyond_mm[None], self._rise(values, points, rim, outwards))

    def _rims(
        self, values: Values, x_mm: Float64Array, y_mm: Float64Array
    ) -> tuple[Float64Array, WallPlaces]:
        """Return the places (..., 2) of the wall beside points, and where these lie."""
        places = self.places(values, x_mm, y_mm)
        rim = np.stack([x_mm, y_mm]) - places.beyond_mm * places.outwards
        return np.moveaxis(rim, 0, -1), places

    def _rise(
        self, values: Values, points: Float64Array, rim: Float64Array, outwards: Float64Array
    ) -> MembraneRise:
        """Return the rise of the undeformed membrane at points and at the wall beside them."""
        middle_mm = self.surface.height(np.array([values["x_mm"], values["y_mm"]]))
        return MembraneRise(
            self.surface.height(points) - middle_mm,
            self.surface.height(rim) - middle_mm,
            (self.surface.slopes(rim) * outwards).sum(axis=-1),
        )


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


def _ball_on(surface: MembraneShape, values: Values, points_mm: Float64Array) -> Float64Array:
    centre = float(values["x_mm"]), float(values["y_mm"])
    pose = BallPose(centre, float(values["diameter_mm"]) / 2.0, float(values["height_mm"]))
    flat = points_mm.reshape(-1, 2)
    upright = flat, np.zeros(flat.shape)
    membrane, _, _ = draped_ball(*upright, pose, decay_mm=values["drape_decay_mm"], surface=surface)
    return np.asarray(surface.height(points_mm) - membrane[:, 2].reshape(points_mm.shape[:-1]))


def _round_places(values: Values, x_mm: Float64Array, y_mm: Float64Array) -> WallPlaces:
    """Return places relative to a circle, of a ball to its centre."""
    offset_mm = np.stack([x_mm - values["x_mm"], y_mm - values["y_mm"]])
    distance_mm = np.maximum(np.hypot(*offset_mm), TINY_MM)
    row = np.arctan2(offset_mm[1], offset_mm[0]) / (2.0 * np.pi) % 1.0 * LINES
    turning = 1.0 / distance_mm
    rows_per_mm = LINES / (2.0 * np.pi) * turning
    return WallPlaces(distance_mm, offset_mm / distance_mm, turning, row, rows_per_mm, {})


def _circle_places(values: Values, x_mm: Float64Array, y_mm: Float64Array) -> WallPlaces:
    of_centre = _round_places(values, x_mm, y_mm)
    beyond_mm = of_centre.beyond_mm - 0.5 * values["diameter_mm"]
    return of_centre._replace(beyond_mm=beyond_mm, walls={"diameter_mm": 1.0})


def _rectangle_places(values: Values, x_mm: Float64Array, y_mm: Float64Array) -> WallPlaces:
    """Return places relative to the wall that is nearest, as if it had no end."""
    along, across = turned(x_mm - values["x_mm"], y_mm - values["y_mm"], values["yaw"])
    half = 0.5 * values["side_a_mm"], 0.5 * values["side_b_mm"]
    beyond = np.abs(along) - half[0], np.abs(across) - half[1]
    of_a = beyond[0] > beyond[1]
    side = np.where(of_a, np.sign(along), np.sign(across))
    outwards = turned(np.where(of_a, side, 0.0), np.where(of_a, 0.0, side), -values["yaw"])
    share = np.clip(np.where(of_a, across / half[1], along / half[0]), -1.0, 1.0)
    wall = np.where(of_a, 0.0, 2.0) + (side > 0.0)
    row = WALL_LINES * wall + 0.5 * (share + 1.0) * (WALL_LINES - 1)
    walls = {"side_a_mm": of_a.astype(np.float64), "side_b_mm": (~of_a).astype(np.float64)}
    rows_per_mm = 0.5 * (WALL_LINES - 1) * side * np.where(of_a, 1.0 / half[1], -1.0 / half[0])
    return WallPlaces(np.where(of_a, *beyond), np.stack(outwards), 0.0, row, rows_per_mm, walls)


def _circle_lines(values: Values, radius_mm: float) -> tuple[Float64Array, Float64Array]:
    """Return places (LINES + 1, 2) on a circle, the last one the first, and the directions."""
    angle = 2.0 * np.pi / LINES * np.arange(LINES + 1)
    outwards = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array([values["x_mm"], values["y_mm"]]) + radius_mm * outwards, outwards


def _rectangle_lines(values: Values) -> tuple[Float64Array, Float64Array]:
    """Return places on the four walls (4 * WALL_LINES, 2), and the directions there."""
    share, side = np.linspace(-1.0, 1.0, WALL_LINES), np.array([-1.0, 1.0])
    along, out = np.tile(share, 2), np.repeat(side, WALL_LINES)
    none = np.zeros(out.size)
    place = np.array([[*out, *along], [*along, *out]])
    half = 0.5 * np.array([[values["side_a_mm"]], [values["side_b_mm"]]])
    middle = np.array([values["x_mm"], values["y_mm"]])
    rim, outwards = (
        np.stack(turned(x, y, -values["yaw"]), axis=1)
        for x, y in (half * place, np.array([[*out, *none], [*none, *out]]))
    )
    return middle + rim, outwards


def _across_circle(values: Values, beyond_mm: Float64Array, rise: MembraneRise) -> Float64Array:
    """Return the depth beyond a cylinder's wall."""
    x_mm = values["x_mm"] + 0.5 * values["diameter_mm"] + beyond_mm
    return cylinder_model_depth(values, x_mm, np.full_like(x_mm, values["y_mm"]), rise)


def _across_wall(values: Values, beyond_mm: Float64Array, rise: MembraneRise) -> Float64Array:
    """Return the depth beyond a wall without ends."""
    form = {name: values[name] for name in ("height_mm", "edge_radius_mm")}
    return wall_depth(beyond_mm, **form, decay_mm=values["drape_decay_mm"], rise=rise)


def _from_centre(values: Values, distance_mm: Float64Array, _: MembraneRise) -> Float64Array:
    """Return the depth of a ball at a distance from its centre."""
    here = {**values, "x_mm": 0.0, "y_mm": 0.0}
    return ball_model_depth(here, distance_mm, np.zeros_like(distance_mm))


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
        _across_circle,
        lambda values: _circle_lines(values, values["diameter_mm"] / 2.0),
        _circle_places,
    ),
    "cuboid": IndenterModel(
        "cuboid",
        (*_PLACE, "side_a_mm", "side_b_mm", "yaw", *_EDGE),
        cuboid_model_depth,
        _start_cuboid,
        _rectangle,
        lambda values: _rectangle(values)[:-1],
        _across_wall,
        _rectangle_lines,
        _rectangle_places,
    ),
    "ball": IndenterModel(
        "ball",
        (*_PLACE, "diameter_mm", "blur_mm2"),
        ball_model_depth,
        _start_ball,
        _ball_outline,
        _no_corners,
        _from_centre,
        lambda values: _circle_lines(values, 0.0),
        _round_places,
        curved_depth=_ball_on,
    ),
}
