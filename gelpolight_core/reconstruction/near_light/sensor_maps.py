"""The data of a calibration for the near-light solver, prepared once for each sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import DARK_COSINE, reflects_light, usable_mask
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.light.facet_interreflection import Slab, flat_light
from gelpolight_core.light.membrane_brdf import CURVE_NODES, MembraneBrdf
from gelpolight_core.light.membrane_field import MembraneField, view_directions
from gelpolight_core.reconstruction.height_map import COARSE, Flag
from gelpolight_core.reconstruction.solver import flat_normals
from gelpolight_core.sensor.sensor_calibration import FullModel, OpenSensor

from .boundary_condition import rim_distance_mm
from .kernel_structures import UNCHANGED, MembraneParameters, PyramidLevel

DEGREE = 7
CURVE_ERROR = 1e-3
"""A polynomial with a larger error, relative to the top of its curve, is not used (0.06 degrees of
slope)."""
LEAST_SHARE = 1e-4
"""Gloss or interreflection weaker than this is left out: it changes no ratio by more."""
ALL_SEEN = ((-1.0, 2.0),) * 3
DEEP_SHARE = 0.15
"""Depth of a deep press over the height of the LEDs, up to which the terms of the light change with
depth as a parabola, within 1e-4."""


@dataclass(frozen=True)
class SensorMaps:
    """All data that does not change from frame to frame.

    Parameters
    ----------
    calibration, full
        Calibrated data of the sensor.
    """

    calibration: OpenSensor
    full: FullModel

    @cached_property
    def usable(self) -> BoolArray:
        """Nodes that can be solved, (rows, columns)."""
        calibration = self.calibration
        return usable_mask(calibration.table.valid, self.full.background, calibration.factors)

    @cached_property
    def inside(self) -> BoolArray:
        """Usable nodes with the holes among them filled: specks, dust, an LED in view."""
        return np.asarray(binary_fill_holes(self.usable))

    @cached_property
    def kind(self) -> NDArray[np.uint8]:
        """`PyramidLevel.kind` at full scale; an effort can need it alone."""
        return node_kinds(self.usable, self.inside, 1)

    @cached_property
    def flags(self) -> NDArray[np.uint8]:
        """Flags of the whole grid while nothing is pressed."""
        without_light = int(Flag.OUTSIDE | Flag.INVALID)
        dark_flags = np.where(self.calibration.table.valid, without_light, int(Flag.OUTSIDE))
        return np.where(self.usable, 0, dark_flags).astype(np.uint8)

    @cached_property
    def normals_at_rest(self) -> Float32Array:
        """Normals (rows, columns, 3) of the undeformed membrane."""
        surface, grid = self.calibration.surface, self.calibration.table.grid
        if surface.flat:
            return flat_normals(grid.shape)
        return surface.normals(grid.points_mm()).astype(np.float32)

    @cached_property
    def membrane(self) -> MembraneParameters:
        """Membrane and lights."""
        return membrane_numbers(self.full, self.calibration.reflectance.coverage)

    @cached_property
    def reflecting(self) -> Float32Array:
        """Share of each node of the field that reflects light onto others, (rows, columns)."""
        mask = reflects_light(self.calibration.table.valid, self.full.background)
        return self.field.filled(block_average(mask.astype(np.float32), COARSE)) + self.field.unseen

    @cached_property
    def field(self) -> MembraneField:
        """The nodes of the coarsest scale, and those that the camera does not see."""
        grid = self.calibration.table.grid
        return MembraneField.around(
            self.calibration.surface,
            *(block_centres(axis, COARSE) for axis in (grid.x_mm, grid.y_mm)),
        )

    @cached_property
    def rays_of_field(self) -> Float64Array:
        """Ray slopes (2, rows, columns) at the nodes of the field."""
        table, field = self.calibration.table, self.field
        slopes = np.moveaxis(block_average(table.ray_slope, COARSE), -1, 0).astype(np.float64)
        seen_slopes = _whole(slopes, field.x_mm[field.seen[1]], field.y_mm[field.seen[0]])
        return np.moveaxis(field.continued(np.moveaxis(seen_slopes, 0, -1)), -1, 0)

    @cached_property
    def flat_of_field(self) -> Float32Array:
        """`PyramidLevel.flat` at the nodes of the field."""
        field, returned = self.field, (self.slab, self.reflecting)
        axes, surface = (field.x_mm, field.y_mm), self.calibration.surface
        return _flat_brightness(self.full, *axes, self.rays_of_field, surface, returned)

    @property
    def slab(self) -> Slab:
        """The layers below the membrane."""
        return Slab.of(self.calibration.stack)

    @cached_property
    def _scales(self) -> dict[int, PyramidLevel]:
        return {}

    @cached_property
    def _sources(self) -> dict[int, tuple[Float32Array, Float32Array, Float32Array]]:
        return {}

    def scale(self, factor: int) -> PyramidLevel:
        """Return the scale with `factor` nodes of the grid to a node: 1, 2 or 4."""
        if factor not in self._scales:
            self._scales[factor] = self._made(factor)
        return self._scales[factor]

    @cached_property
    def returned(self) -> Float32Array:
        """Share of the background that the lower face returns, (3, rows, columns), coarsest."""
        scale = self.scale(COARSE)
        y, x = (
            first + scale.pitch_mm * np.arange(n)
            for first, n in zip((scale.y_mm, scale.x_mm), scale.kind.shape, strict=True)
        )
        rays, surface = scale.rays[:2].astype(np.float64), self.calibration.surface
        direct = _flat_brightness(self.full, x, y, rays, surface)
        return np.asarray(1.0 - direct / scale.flat, np.float32)

    @cached_property
    def rim_distance_mm(self) -> Float32Array:
        """How far nodes of the coarsest scale are from the boundary of the field."""
        scale = self.scale(COARSE)
        return rim_distance_mm(scale.kind > 0, scale.pitch_mm)

    def source(self, factor: int) -> tuple[Float32Array, Float32Array, Float32Array]:
        """Return raw pixel (u, v) and background (..., 3) of each node at scale 1 or 2."""
        if factor not in self._sources:
            table = self.calibration.table
            maps = (table.u_px, table.v_px, self.full.background)
            resampled = maps if factor == 1 else tuple(block_average(m, factor) for m in maps)
            self._sources[factor] = (resampled[0], resampled[1], resampled[2])
        return self._sources[factor]

    def _made(self, factor: int) -> PyramidLevel:
        grid = self.calibration.table.grid
        kind = node_kinds(self.usable, self.inside, factor)
        x, y = (block_centres(axis, factor) for axis in (grid.x_mm, grid.y_mm))
        position = (factor, float(x[0]), float(y[0]), grid.pitch_mm * factor)
        if factor < COARSE:
            # The flat membrane's brightness and the rays change little from node to node.
            coarse = self.scale(COARSE)
            flat, by_depth = (
                np.array([cv2.resize(m, (x.size, y.size)) for m in maps], np.float32)
                for maps in (coarse.flat, coarse.by_depth)
            )
            rest = rest_heights(self.calibration.surface, x, y)
            by_depth = by_depth.reshape(-1, y.size, x.size)
            return PyramidLevel(*position, flat, kind, coarse.rays, factor / COARSE, rest, by_depth)
        window = (slice(None), *self.field.seen)
        return sensor_scale(
            self.full,
            (x, y),
            self.rays_of_field[window],
            kind,
            factor=factor,
            flat=np.ascontiguousarray(self.flat_of_field[window]),
            surface=self.calibration.surface,
        )


def sensor_scale(
    full: FullModel,
    axes_mm: tuple[Float64Array, Float64Array],
    ray_slope: NDArray[Any],
    kind: Any,
    *,
    factor: int,
    flat: Float32Array | None = None,
    surface: MembraneShape = FLAT,
) -> PyramidLevel:
    """Return a scale with ray maps of its own.

    Parameters
    ----------
    full : FullModel
        Lights and membrane.
    axes_mm : ((columns,), (rows,))
        Nodes, x and y.
    ray_slope : (2, rows, columns)
        Sideways move of the rays per mm of depth; NaN where no ray arrives.
    kind : (rows, columns) uint8
        As in :class:`PyramidLevel`.
    factor : int
        As in :class:`PyramidLevel`.
    flat : (3, rows, columns) float32, optional
        As in :class:`PyramidLevel`; by default that of direct light.
    surface : MembraneShape, optional
        The undeformed membrane.
    """
    x, y = axes_mm
    pitch = float(x[1] - x[0])
    whole = _whole(np.asarray(ray_slope, np.float64), x, y)
    rays = np.empty((6, y.size, x.size), np.float32)
    rays[:2] = whole
    for position, axis in ((2, 1), (4, 0)):
        for k in range(2):
            rays[position + k] = np.gradient(whole[k], pitch, axis=axis)
    flat = _flat_brightness(full, x, y, whole, surface) if flat is None else flat
    rest = rest_heights(surface, x, y)
    by_depth = light_by_depth(full, (x, y), whole, surface)
    corner = float(x[0]), float(y[0])
    return PyramidLevel(factor, *corner, pitch, flat, kind, rays, 1.0, rest, by_depth)


def light_by_depth(
    full: FullModel,
    axes_mm: tuple[Float64Array, Float64Array],
    ray_slope: Float64Array,
    surface: MembraneShape,
) -> Float32Array:
    """Return `PyramidLevel.by_depth` of nodes at x and y.

    Parameters
    ----------
    full, axes_mm, surface
        As in :func:`sensor_scale`.
    ray_slope : (2, rows, columns)
        Known everywhere.
    """
    light, leds_mm = full.membrane.light, full.led_positions_mm
    if not light.by_place:
        return UNCHANGED
    at_rest = surface.points(np.stack(np.meshgrid(*axes_mm), axis=-1))
    ray = np.dstack([*ray_slope, -np.ones(ray_slope.shape[1:])])
    length, deep_mm = np.linalg.norm(ray, axis=-1), DEEP_SHARE * np.abs(leds_mm[:, 2]).min()

    def inverse(depth_mm: float) -> Float64Array:
        lit = light.from_leds(leds_mm, at_rest + depth_mm * ray) * light.to_camera(
            depth_mm * length
        )
        return np.asarray(1.0 / np.moveaxis(lit, -1, 0))

    at_rest_inverse, half, whole = (inverse(share * deep_mm) for share in (0.0, 0.5, 1.0))
    slope = (4.0 * half - whole - 3.0 * at_rest_inverse) / deep_mm
    bend = 2.0 * (whole - 2.0 * half + at_rest_inverse) / deep_mm**2
    return np.ascontiguousarray(np.concatenate([at_rest_inverse, slope, bend]), np.float32)


def rest_heights(
    surface: MembraneShape, x_mm: Float64Array, y_mm: Float64Array
) -> Float32Array | None:
    """Return `PyramidLevel.rest` of nodes at x and y, or None for a flat membrane."""
    if surface.flat:
        return None
    points = np.stack(np.meshgrid(x_mm, y_mm), axis=-1)
    slopes = np.moveaxis(surface.slopes(points), -1, 0)
    return np.stack([surface.height(points), *slopes]).astype(np.float32)


def node_kinds(usable: BoolArray, inside: BoolArray, factor: int) -> NDArray[np.uint8]:
    """Return `PyramidLevel.kind`: all of a usable block is usable, most of one inside is inside."""
    if factor == 1:
        return np.where(usable, 2, inside).astype(np.uint8)
    all_usable = block_average(usable.astype(np.float32), factor) > 0.99
    mostly_inside = block_average(inside.astype(np.float32), factor) > 0.5
    return np.where(all_usable, 2, mostly_inside).astype(np.uint8)


def membrane_numbers(
    full: FullModel, coverage: Sequence[Sequence[float]] | NDArray[Any] = ALL_SEEN
) -> MembraneParameters:
    """Return membrane and lights in the form for the compiled solver.

    Parameters
    ----------
    full : FullModel
        Lights and membrane of the sensor.
    coverage : (3, 2), optional
        Cosines of each light that the ball presses have shown; by default all.
    """
    membrane = full.membrane
    curves, error = _polynomials(membrane)
    leds = [_triple(led) for led in full.led_positions_mm]
    glossy = membrane.gloss > LEAST_SHARE
    return MembraneParameters(
        (leds[0], leds[1], leds[2]),
        _triple(dark_brightness(membrane)),
        curves,
        None if error <= CURVE_ERROR else _table(membrane),
        (_single(membrane.gloss), _single(membrane.roughness**2)) if glossy else None,
        _single(membrane.interreflection if membrane.interreflection > LEAST_SHARE else 0.0),
        tuple((_single(low), _single(high)) for low, high in np.asarray(coverage)),
        _single(membrane.light.stretch_loss),
    )


def _polynomials(membrane: MembraneBrdf) -> tuple[tuple[tuple[float, ...], ...], float]:
    """Return the diffuse curves, over pi, as polynomials, and their largest error."""
    cosines = np.linspace(0.0, 1.0, CURVE_NODES)[1:]
    expected = membrane.diffuse_share(np.tile(cosines[:, None], (1, 3)))
    curves, error = [], 0.0
    for k in range(3):
        fitted = np.polynomial.Polynomial.fit(cosines, expected[:, k], DEGREE)
        error_k = np.abs(fitted(cosines) - expected[:, k]).max() / expected[-1, k]
        error = max(error, float(error_k))
        share = np.asarray(fitted.convert(domain=(-1, 1)).coef, np.float64)
        share *= (1.0 - membrane.gloss) / pi
        curves.append(tuple(_single(v) for v in np.pad(share, (0, DEGREE + 1 - len(share)))))
    return tuple(curves), error


def _table(membrane: MembraneBrdf) -> Float32Array:
    """Return the diffuse curves, over pi, at even cosines."""
    cosines = np.linspace(0.0, 1.0, CURVE_NODES)
    share = membrane.diffuse_share(np.tile(cosines[:, None], (1, 3)))
    return np.ascontiguousarray(share.T * (1.0 - membrane.gloss) / pi, np.float32)


def _whole(ray_slope: Float64Array, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return ray slopes with unknown ones filled in by a plane through the rest."""
    finite_mask = np.isfinite(ray_slope).all(axis=0)
    if finite_mask.all() or not finite_mask.any():
        return np.nan_to_num(ray_slope)
    x, y = np.meshgrid(x_mm, y_mm)
    terms = np.stack([x, y, np.ones_like(x)], axis=-1)
    plane, *_ = np.linalg.lstsq(terms[finite_mask], ray_slope[:, finite_mask].T, rcond=None)
    return np.asarray(np.where(finite_mask, ray_slope, np.moveaxis(terms @ plane, -1, 0)))


def _flat_brightness(
    full: FullModel,
    x: Float64Array,
    y: Float64Array,
    ray_slope: Float64Array,
    surface: MembraneShape,
    returned: tuple[Slab, Float32Array] | None = None,
) -> Float32Array:
    """Return `PyramidLevel.flat`, with the light that a slab reflects from the given nodes."""
    membrane, view = full.membrane, view_directions(np.moveaxis(ray_slope, 0, -1))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    points, normals = surface.points(places), surface.normals(places)
    if returned is None or membrane.interreflection <= LEAST_SHARE:
        flat = membrane.direct(full.led_positions_mm, points, normals, view)
    else:
        (slab, reflecting), pitch = returned, float(x[1] - x[0])
        direct, more = flat_light(
            points, normals, view, reflecting, full.led_positions_mm, membrane, pitch, slab
        )
        flat = -direct - membrane.interreflection * more
    return np.ascontiguousarray(np.moveaxis(flat, -1, 0), np.float32)


def block_average(values: NDArray[Any], factor: int) -> Float32Array:
    """Return averages over blocks of nodes."""
    rows, columns = (n // factor for n in values.shape[:2])
    whole = np.ascontiguousarray(values[: rows * factor, : columns * factor], np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))


def block_centres(axis_mm: Float64Array, factor: int) -> Float64Array:
    """Return the middles of blocks of nodes along an axis."""
    count = axis_mm.size // factor
    return np.asarray(axis_mm[: count * factor].reshape(count, factor).mean(axis=1))


def _single(value: float) -> float:
    """Return a number that the compiled code takes as single precision."""
    return np.float32(value)  # type: ignore[return-value]


def _triple(values: NDArray[np.floating]) -> tuple[float, float, float]:
    return (_single(values[0]), _single(values[1]), _single(values[2]))


def dark_brightness(membrane: MembraneBrdf) -> NDArray[np.float64]:
    """Return the membrane's brightness (3,) below which a channel is dark whatever its noise."""
    share = membrane.diffuse_share(np.full(3, DARK_COSINE))
    return np.asarray((1.0 - membrane.gloss) * share / pi)
