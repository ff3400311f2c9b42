"""Pixels of the ball presses for the joint refinement: press over background, and camera rays.

They receive light that the membrane around a pressed ball reflects. It follows from the present
estimate of the ball and its drape, and is computed again when the estimate improves. It is computed
for a membrane that absorbs no light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.facet_interreflection import FacetSurface as LitSurface
from gelpolight_core.light.facet_interreflection import (
    LightReceivers,
    Slab,
    flat_light,
    gather_interreflection,
    projected_facet_area,
    ratio_reflected,
)
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.membrane_field import MembraneField, view_directions
from gelpolight_core.reconstruction.near_light.sensor_maps import block_average, block_centres
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import LEAST_VALUE, BallPress
from gelpolight_core.stages.balls.draped_ball import draped_ball

DRAPE_WIDTH_MM = 1.6
EDGE_GAP_MM = 0.12
# Light that a convex cap receives from its surroundings comes from further away and is modelled
# less well.
CAP_TRUST = 0.3
MODEL_ERROR = 0.01


@dataclass(frozen=True, slots=True)
class CoarseRayGrid:
    """Camera rays over the whole membrane, on coarse nodes.

    Attributes
    ----------
    points_mm, ray_slope : (rows * columns, 2)
        Where the rays meet the undeformed membrane, and their slope.
    view : (rows, columns, 3)
        Unit directions back to the camera.
    reflecting : (rows, columns) float32
        Share of each facet that reflects light onto other parts of the membrane.
    pitch_mm : float
        Distance between nodes.
    factor : int
        Nodes of the calibration's grid to one of these, along an axis.
    surface : MembraneShape
        The undeformed membrane.
    field : MembraneField, optional
        Which nodes the camera sees; by default all.
    """

    points_mm: Float64Array
    ray_slope: Float64Array
    view: Float64Array
    reflecting: Float32Array
    pitch_mm: float
    factor: int
    surface: MembraneShape = FLAT
    field: MembraneField | None = None

    @classmethod
    def of(cls, table: ResamplingTable, reflecting: NDArray[np.bool_]) -> CoarseRayGrid:
        """Return the coarse view of a table's grid with its reflecting nodes (rows, columns)."""
        grid = table.grid
        # Approximate width of the facets that reflect light.
        factor = max(round(0.1 / grid.pitch_mm), 1)
        share = block_average(reflecting.astype(np.float32), factor)
        ray_slope = np.nan_to_num(block_average(table.ray_slope, factor)).astype(np.float64)
        x, y = (block_centres(axis, factor) for axis in (grid.x_mm, grid.y_mm))
        field = MembraneField.around(table.surface, x, y)
        points = np.stack(np.meshgrid(field.x_mm, field.y_mm), axis=-1).reshape(-1, 2)
        ray_slope, share = field.continued(ray_slope), field.filled(share) + field.unseen
        return cls(
            points,
            ray_slope.reshape(-1, 2),
            view_directions(ray_slope),
            share,
            factor * grid.pitch_mm,
            factor,
            table.surface,
            field,
        )

    def whole(self, seen: Float32Array) -> Float32Array:
        """Return values (rows, columns, ...) for all nodes, 0 where the camera does not see."""
        return seen if self.field is None else self.field.filled(seen)

    def index(self, points_mm: Float64Array) -> Float64Array:
        """Return row and column (N, 2) of points (N, 2)."""
        return np.asarray((points_mm - self.points_mm[0])[:, ::-1] / self.pitch_mm)

    def at(self, values: Float64Array, points_mm: Float64Array) -> Float64Array:
        """Return values (rows, columns, 3) at points (N, 2)."""
        return _at(values, self.index(points_mm))

    def light_at_rest(
        self, leds_mm: Float64Array, membrane: MembraneBrdf, slab: Slab
    ) -> tuple[Float64Array, Float64Array]:
        """Return direct and returned light of the membrane at rest, as :func:`flat_light`."""
        shape = self.reflecting.shape
        points = self.surface.points(self.points_mm).reshape(*shape, 3)
        up = self.surface.normals(self.points_mm).reshape(*shape, 3)
        return flat_light(
            points, up, self.view, self.reflecting, leds_mm, membrane, self.pitch_mm, slab
        )


@dataclass(frozen=True, slots=True)
class BallPixels:
    """Pixels of one press on the ball's cap and on the drape around it.

    Attributes
    ----------
    points_mm, ray_slope, view : (N, 2), (N, 2), (N, 3)
        Camera rays (point and ray slope), and unit directions back to the camera.
    ratio, weight : (N, 3)
        Press over background, and 1 / its standard deviation.
    radius_mm : float
        Radius of the ball.
    view_of_field : CoarseRayGrid
        The whole membrane, which can reflect light onto them.
    field : (rows, columns, 3) float32
        Press over background there; 1 where it is not usable, and 0 where nothing reflects light.
    around, around_flat : (N, 3)
        Light that they receive from the rest of a membrane that absorbs nothing, in the press and
        while the membrane is flat, in units of the flat membrane's direct light.
    surface : MembraneShape
        The undeformed membrane.
    """

    points_mm: Float64Array
    ray_slope: Float64Array
    view: Float64Array
    ratio: Float64Array
    weight: Float64Array
    radius_mm: float
    view_of_field: CoarseRayGrid
    field: Float32Array
    around: Float64Array
    around_flat: Float64Array
    surface: MembraneShape = FLAT

    def on(self, surface: MembraneShape) -> BallPixels:
        """Return the same rays with another membrane at rest."""
        height_mm = self.surface.height(self.points_mm)[:, None]
        at = surface.met_by(self.points_mm + height_mm * self.ray_slope, self.ray_slope)
        return replace(self, points_mm=at, surface=surface)

    def with_response(self, exponent: float) -> BallPixels:
        """Return the pixels if a power of the camera's values is proportional to light."""
        seen = np.maximum(self.ratio, LEAST_VALUE)
        light = seen**exponent
        # Residuals are still those of the camera's values.
        return replace(self, ratio=light, weight=self.weight * seen / (exponent * light))

    def with_contrast(self, contrast: float) -> BallPixels:
        """Return the pixels of which the camera shows a contrast: the rest is the background."""
        light = 1.0 + (self.ratio - 1.0) / contrast
        return replace(self, ratio=light, weight=self.weight * contrast)


def gather_ball_pixels(
    press: BallPress,
    image: Float32Array,
    background: Float32Array,
    table: ResamplingTable,
    view: CoarseRayGrid,
    usable: NDArray[np.bool_],
    noise: Float64Array,
) -> BallPixels:
    """Choose pixels on a ball's cap and on the drape around it.

    Parameters
    ----------
    press : BallPress
        The detected ball.
    image, background : (rows, columns, 3) float32
        Resampled, crosstalk removed.
    table : ResamplingTable
        The grid and its rays.
    view : CoarseRayGrid
        Coarse view of that grid.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    noise : (3,)
        Standard deviation of press minus background.
    """
    grid = table.grid
    base = np.maximum(background, LEAST_VALUE)
    ratio = np.asarray(image / base, np.float32)
    whole = view.whole(block_average(usable.astype(np.float32), view.factor))[..., None] > 0.99
    coarse_ratio = view.whole(np.minimum(block_average(ratio, view.factor), np.float32(4.0)))
    field = ratio_reflected(coarse_ratio, whole, view.reflecting)
    column, row = np.round(grid.to_index(np.asarray(press.pose.centre_mm))).astype(int)
    centre = press.seen_centre_mm(table.ray_slope[row, column].astype(np.float64))
    centre = centre + press.lean_mm(table.surface)
    distance_mm = np.hypot(grid.x_mm[None, :] - centre[0], grid.y_mm[:, None] - centre[1])
    contact = press.contact_radius_mm
    random = np.random.default_rng(0)
    parts = (
        (CAP_TRUST, 0.0, 0.9 * contact),
        (1.0, contact + EDGE_GAP_MM, contact + DRAPE_WIDTH_MM),
    )
    indices_by_part, trust = [], []
    for part, low, high in parts:
        indices = np.flatnonzero((usable & (distance_mm >= low) & (distance_mm < high)).ravel())
        indices_by_part.append(random.permutation(indices)[:800])
        trust.append(np.full((indices_by_part[-1].size, 1), part))
    rows, columns = np.unravel_index(np.concatenate(indices_by_part), distance_mm.shape)
    value = image[rows, columns].astype(np.float64)
    below = base[rows, columns].astype(np.float64)
    valid = (value > LEAST_VALUE) & (value < SATURATED) & (background[rows, columns] > LEAST_VALUE)
    sd = np.hypot(np.hypot(noise / np.sqrt(2.0), MODEL_ERROR * value) / below, MODEL_ERROR)
    ray_slope = table.ray_slope[rows, columns].astype(np.float64)
    return BallPixels(
        np.stack([grid.x_mm[columns], grid.y_mm[rows]], axis=-1),
        ray_slope,
        view_directions(ray_slope),
        value / below,
        np.where(valid, np.concatenate(trust) / sd, 0.0),
        press.pose.radius_mm,
        view,
        field.astype(np.float32),
        np.zeros_like(value),
        np.zeros_like(value),
        table.surface,
    )


def every_second_pixel(pixels: BallPixels) -> BallPixels:
    """Return every second pixel of a press, with the weight of both: errors are correlated."""
    names = ("points_mm", "ray_slope", "view", "ratio", "weight", "around", "around_flat")
    half: dict[str, Any] = {
        name: np.ascontiguousarray(getattr(pixels, name)[::2]) for name in names
    }
    half["weight"] *= np.sqrt(2.0)
    return replace(pixels, **half)


def add_ball_interreflection(
    pixels: Sequence[BallPixels],
    balls: Sequence[BallPose],
    decay_mm: float,
    leds_mm: Float64Array,
    membrane: MembraneBrdf,
    slab: Slab,
) -> list[BallPixels]:
    """Return the pixels with the light that they receive from other parts of the membrane.

    Parameters
    ----------
    pixels, balls : sequences of equal length
        Pixels and ball pose of each press.
    decay_mm : float
        Decay length of the drape.
    leds_mm : (3, 3)
        LED positions in the sensor frame.
    membrane : MembraneBrdf
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
    flat, returned = view.light_at_rest(leds_mm, membrane, slab)
    background = flat + membrane.interreflection * returned

    def lit(pair: tuple[BallPixels, BallPose]) -> BallPixels:
        press, ball = pair
        drape = partial(draped_ball, pose=ball, decay_mm=decay_mm, surface=at_rest)
        surface, normals, _ = drape(points, view.ray_slope)
        surface, normals = surface.reshape(*shape, 3), normals.reshape(*shape, 3)
        leaving = press.field * background
        if membrane.terms:
            nearer_mm = np.linalg.norm(surface - facets, axis=-1)
            leaving = leaving / membrane.light.to_camera(nearer_mm)
        field = LitSurface(surface, normals, view.view, leaving)
        if not at_rest.flat:
            field = field._replace(
                across=projected_facet_area(field.points_mm, view.view, view.pitch_mm)
            )
        places, at, _ = drape(press.points_mm, press.ray_slope)
        place = view.index(press.points_mm)
        nearest = np.clip(np.round(place), 0, np.array(shape) - 1)
        receivers = LightReceivers(places, at, press.view, nearest)
        light = gather_interreflection(
            field, receivers, leds_mm, membrane, view.pitch_mm, slab=slab
        ).light
        level = np.maximum(_at(flat, place), 1e-9)
        return replace(press, around=light / level, around_flat=_at(returned, place) / level)

    return list(in_parallel(lit, list(zip(pixels, balls, strict=True))))


def _at(values: Float64Array, place: Float64Array) -> Float64Array:
    """Return values (rows, columns, 3) between nodes, at rows and columns (N, 2)."""
    row, column = (np.ascontiguousarray(p, np.float32) for p in place.T)
    channels = [
        cv2.remap(
            np.ascontiguousarray(values[..., k], np.float32),
            column[:, None],
            row[:, None],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )[:, 0]
        for k in range(3)
    ]
    return np.stack(channels, axis=-1).astype(np.float64)
