"""Brightness of membrane points under the lamps, and of the pixels that show them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, uniform_filter

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .design_parts import MembraneDesign
from .occlusion import lamp_share, sample, sample_all, visible_depth
from .pressed_surface import PressedSurface
from .rays import RayTable
from .simulation_kernel import Interrupt, compiled, never_interrupt

_LEAST_COATING = 0.3
"""Least share of the reflectance. The loss is proportional to the gain of area only while that is
small: on a wall it would exceed all that there is, but some of the coating stays."""

_PIXELS_AT_ONCE = 1 << 15  # takes a few hundredths of a second

_ROUGH_SHARE = 0.002
"""Deviation from the neighbours' mean, as a share of the peak, above which more rays are used."""


@dataclass(frozen=True, slots=True)
class SurfaceMaterial:
    """Reflection properties of a surface.

    Attributes
    ----------
    diffuse : float
        Reflectance of the Lambertian component, including its weight.
    specular : float
        Reflectance at normal incidence of the metallic component, including its weight.
    roughness : float
        GGX alpha of the metallic component.
    stretch_loss : float
        Share of the reflectance that is lost where stretch doubles the area.
    curvature_per_mm : float
        1 / radius of the surface at rest, a sphere about the axis.
    """

    diffuse: float
    specular: float = 0.0
    roughness: float = 0.5
    stretch_loss: float = 0.0
    curvature_per_mm: float = 0.0

    @classmethod
    def of_membrane(cls, membrane: MembraneDesign) -> SurfaceMaterial:
        """Return the membrane of a design."""
        weight = membrane.specular_weight
        return cls(
            (1.0 - weight) * membrane.diffuse_reflectance,
            weight * membrane.specular_reflectance,
            membrane.roughness,
            membrane.stretch_loss,
            membrane.curvature_per_mm,
        )

    @property
    def values(self) -> tuple[float, float, float, float, float]:
        """The material in the format of the compiled code."""
        return (
            self.diffuse,
            self.specular,
            self.roughness,
            self.stretch_loss,
            self.curvature_per_mm,
        )


@dataclass(frozen=True, slots=True)
class IndirectLight:
    """Brightness towards the camera due to light from other parts of the surface.

    Attributes
    ----------
    maps : (lamps, rows, columns)
        For a reflectance factor of 1; empty without interreflection.
    first_mm, pitch_mm : float
        Position of the first cell in x and y, and the cell size.
    """

    maps: Float64Array
    first_mm: float
    pitch_mm: float

    @property
    def values(self) -> tuple[Float64Array, float, float]:
        """The light in the format of the compiled code."""
        return self.maps, self.first_mm, self.pitch_mm

    def add_flat(self, light: Float64Array, rays: RayTable) -> None:
        """Add what each pixel sees of it on the flat surface to (rows, columns, lamps), in place.

        Parameters
        ----------
        light : (rows, columns, lamps)
            Brightness without losses.
        rays : RayTable
            Rays of the pixels.
        """
        column = np.asarray((rays.x_mm - self.first_mm) / self.pitch_mm)
        row = np.asarray((rays.y_mm - self.first_mm) / self.pitch_mm)
        for k, values in enumerate(self.maps):
            light[..., k] += sample_all(values, column, row)


NO_LIGHT = IndirectLight(np.zeros((0, 1, 1)), 0.0, 1.0)


@compiled
def metallic_lobe(
    n_l: float, n_v: float, n_h: float, v_h: float, alpha: float
) -> float:  # pragma: no cover - compiled
    """Return pi times the reflectance density of rough metal of unit reflectance.

    Facets have a GGX (Trowbridge-Reitz) distribution with Smith masking and shadowing. The
    reflectance of a metal rises to 1 at grazing incidence; the caller applies this (`v_h` is passed
    for it).
    """
    a2 = alpha * alpha
    width = n_h * n_h * (a2 - 1.0) + 1.0
    facets = a2 / (width * width)
    masking_view = 2.0 / (1.0 + math.sqrt(1.0 + a2 * (1.0 / (n_v * n_v) - 1.0)))
    masking_light = 2.0 / (1.0 + math.sqrt(1.0 + a2 * (1.0 / (n_l * n_l) - 1.0)))
    return facets * masking_view * masking_light / (4.0 * n_l * n_v)


@compiled
def metallic_rise(v_h: float) -> float:  # pragma: no cover - compiled
    """Return the metal's reflectance relative to normal incidence."""
    return 1.0 + (1.0 / 0.91 - 1.0) * (1.0 - v_h) ** 5


@compiled
def coating_share(point: Any, normal: Any, material: Any) -> float:  # pragma: no cover - compiled
    """Return the share of the reflectance that a stretched coating keeps.

    The amount of pigment stays while its area grows from A0 to A, so the coating becomes thinner,
    and its reflectance falls in proportion to the gain of area: 1 - stretch_loss * (A / A0 - 1). A
    membrane that is pressed along z gains 1 / cos of its slope, divided by the same at rest. Where
    the area shrinks, the coating is as opaque as at rest.
    """
    loss, curvature = material[3], material[4]
    if loss <= 0.0:
        return 1.0
    bent = curvature * curvature * (point[0] * point[0] + point[1] * point[1])
    gain = math.sqrt(max(0.0, 1.0 - bent)) / -normal[2] - 1.0
    return float(min(1.0, max(_LEAST_COATING, 1.0 - loss * gain)))


@compiled
def passed_share(lamp: Any, path_mm: float) -> float:  # pragma: no cover - compiled
    """Return the share of a lamp's light that is left after a path in the elastomer."""
    return math.exp(-lamp[9] * path_mm) if lamp[9] > 0.0 else 1.0


@compiled
def point_brightness(
    point: Any, normal: Any, to_camera: Any, lamp: Any, material: Any
) -> float:  # pragma: no cover - compiled
    """Return the brightness of a point under one unobstructed lamp.

    Irradiance is proportional to 1/r^2, the lamp's lobe, the share that passes the elastomer and
    the cosine at the surface; a Lambertian surface of reflectance 1 has the brightness of its
    irradiance.
    """
    lx, ly, lz = lamp[0] - point[0], lamp[1] - point[1], lamp[2] + point[2]
    r2 = lx * lx + ly * ly + lz * lz
    r = math.sqrt(r2)
    lx, ly, lz = lx / r, ly / r, lz / r
    from_axis = -(lx * lamp[6] + ly * lamp[7] + lz * lamp[8])
    if lz >= 0.0 or from_axis <= 0.0:
        return 0.0
    strength = lamp[3] * from_axis ** lamp[4] / r2
    if lamp[9] > 0.0:
        # The part of the path from a lamp below the elastomer to the elastomer has no loss.
        strength *= passed_share(lamp, min(r, (lamp[10] - point[2]) / -lz))
    n_l = normal[0] * lx + normal[1] * ly + normal[2] * lz
    if n_l <= 0.0:
        return 0.0
    reflected = material[0]
    n_v = normal[0] * to_camera[0] + normal[1] * to_camera[1] + normal[2] * to_camera[2]
    if material[1] > 0.0 and n_v > 1e-6:
        hx, hy, hz = lx + to_camera[0], ly + to_camera[1], lz + to_camera[2]
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        v_h = (to_camera[0] * hx + to_camera[1] * hy + to_camera[2] * hz) / h
        n_h = (normal[0] * hx + normal[1] * hy + normal[2] * hz) / h
        metal = material[1] * metallic_rise(v_h)
        reflected += metal * metallic_lobe(n_l, n_v, n_h, v_h, material[2])
    return float(strength * n_l * reflected)


@compiled
def _flat(
    x: Any, y: Any, slope_x: Any, slope_y: Any, lamps: Any, material: Any
) -> Any:  # pragma: no cover - compiled
    rows, columns = x.shape
    out = np.zeros((rows, columns, lamps.shape[0]))
    for i in range(rows):
        for j in range(columns):
            sx, sy = slope_x[i, j], slope_y[i, j]
            length = math.sqrt(1.0 + sx * sx + sy * sy)
            view = (-sx / length, -sy / length, -1.0 / length)
            for k in range(lamps.shape[0]):
                out[i, j, k] = point_brightness(
                    (x[i, j], y[i, j], 0.0), (0.0, 0.0, -1.0), view, lamps[k], material
                )
    return out


def flat_brightness(rays: RayTable, lamps: Float64Array, material: SurfaceMaterial) -> Float64Array:
    """Return (rows, columns, lamps): the flat surface's brightness at each pixel, no losses."""
    return np.asarray(
        _flat(rays.x_mm, rays.y_mm, rays.slope_x, rays.slope_y, lamps, material.values)
    )


def lose_on_camera_rays(
    light: Float64Array, rays: RayTable, lamps: Float64Array, cover: Float64Array | float = 1.0
) -> None:
    """Take the losses between the flat surface and the camera from its brightness, in place.

    Parameters
    ----------
    light : (rows, columns, lamps)
        Brightness without losses.
    rays : RayTable
        Rays of the pixels.
    lamps : (lamps, 11)
        Lamp table.
    cover : (rows, columns), optional
        Share of each pixel that shows the surface.
    """
    light *= (rays.transmission * cover)[..., None]
    for k, lamp in enumerate(lamps):
        if lamp[9] > 0.0:
            path_mm = lamp[10] * np.sqrt(1.0 + rays.slope_x**2 + rays.slope_y**2)
            light[..., k] *= np.exp(-lamp[9] * path_mm)


@compiled
def _blend(table: Any, row: float, column: float) -> float:  # pragma: no cover - compiled
    """Return a smooth per-pixel table between pixels, extrapolated linearly beyond its border."""
    i = min(max(math.floor(row), 0), table.shape[0] - 2)
    j = min(max(math.floor(column), 0), table.shape[1] - 2)
    a, b = row - i, column - j
    top = table[i, j] + b * (table[i, j + 1] - table[i, j])
    bottom = table[i + 1, j] + b * (table[i + 1, j + 1] - table[i + 1, j])
    return float(top + a * (bottom - top))


@compiled
def _pressed(
    out: Any,
    pixels: Any,
    rays: Any,
    surface: Any,
    grid: Any,
    factor: Any,
    lamps: Any,
    material: Any,
    indirect: Any,
    samples: int,
) -> None:  # pragma: no cover - compiled
    depth, slope_x, slope_y, tile_max, tile_min = surface
    x0, y0, pitch, deepest = grid
    factors, factor_x0, factor_pitch, rim = factor
    gathered, gathered_first, gathered_pitch = indirect
    share = 1.0 / (samples * samples)
    value = np.zeros(lamps.shape[0])
    for number in range(pixels.shape[0]):
        i, j = pixels[number, 0], pixels[number, 1]
        value[:] = 0.0
        for part in range(samples * samples):
            row = i + (part // samples + 0.5) / samples - 0.5
            column = j + (part % samples + 0.5) / samples - 0.5
            x, y = _blend(rays[0], row, column), _blend(rays[1], row, column)
            sx, sy = _blend(rays[2], row, column), _blend(rays[3], row, column)
            cell = ((x - x0) / pitch, (y - y0) / pitch)
            move = (-sx / pitch, -sy / pitch)
            d = visible_depth(depth, tile_max, tile_min, deepest, cell, move)
            px, py = x - d * sx, y - d * sy
            if px * px + py * py > rim * rim:
                continue
            at = ((px - x0) / pitch, (py - y0) / pitch)
            gx, gy = sample(slope_x, at[0], at[1]), sample(slope_y, at[0], at[1])
            length = math.sqrt(1.0 + gx * gx + gy * gy)
            normal = (-gx / length, -gy / length, -1.0 / length)
            length = math.sqrt(1.0 + sx * sx + sy * sy)
            view = (-sx / length, -sy / length, -1.0 / length)
            rho = sample(factors, (px - factor_x0) / factor_pitch, (py - factor_x0) / factor_pitch)
            rho *= coating_share((px, py, d), normal, material)
            for k in range(lamps.shape[0]):
                bright = point_brightness((px, py, d), normal, view, lamps[k], material)
                if bright > 0.0:
                    bright *= lamp_share(depth, tile_max, grid, (px, py, d), lamps[k])
                passed = passed_share(lamps[k], (lamps[k, 10] - d) * length)
                value[k] += share * rho * bright * passed
                if gathered.shape[0] > 0:
                    value[k] += (
                        share
                        * rho
                        * sample(
                            gathered[k],
                            (px - gathered_first) / gathered_pitch,
                            (py - gathered_first) / gathered_pitch,
                        )
                        * passed
                    )
        through = rays[4][i, j]
        for k in range(lamps.shape[0]):
            out[i, j, k] = value[k] * through


def shade_pressed(
    out: Float64Array,
    rays: RayTable,
    surface: PressedSurface,
    factors: tuple[Float64Array, float, float, float],
    lamps: Float64Array,
    material: SurfaceMaterial,
    indirect: IndirectLight = NO_LIGHT,
    *,
    samples: int = 3,
    interrupt: Interrupt = never_interrupt,
) -> None:
    """Render the pixels that see a pressed patch, in place.

    Parameters
    ----------
    out : (rows, columns, lamps)
        Image of the bare membrane, modified in place.
    rays : RayTable
        Rays of all pixels.
    surface : PressedSurface
        The patch.
    factors : (map, first position in mm, pitch in mm, working radius in mm)
        Reflectance factor over the membrane.
    lamps : (lamps, 11)
        Lamp table.
    material : SurfaceMaterial
        Material of the membrane.
    indirect : IndirectLight, optional
        Light from other parts of the membrane.
    samples : int, optional
        Rays per pixel and side at edges; 1 is fastest.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.
    """
    deepest = float(surface.depth_mm.max(initial=0.0))
    if deepest <= 0.0:
        return
    window = _seen_window(rays, surface, deepest)
    if window is None:
        return
    rows, columns = window
    pixels = np.argwhere(np.isfinite(rays.x_mm[window]))
    corner = np.array([rows.start, columns.start])
    parts = (
        (rays.x_mm, rays.y_mm, rays.slope_x, rays.slope_y, rays.transmission),
        (surface.depth_mm, surface.slope_x, surface.slope_y, surface.tile_max, surface.tile_min),
        (surface.x0_mm, surface.y0_mm, surface.pitch_mm, deepest),
        factors,
        lamps,
        material.values,
        indirect.values,
    )
    peak = float(out.max(initial=0.0))
    for portion in _portions(pixels + corner, interrupt):
        _pressed(out, portion, *parts, 1)
    if samples > 1:
        rough = np.argwhere(_is_rough(out[window], _ROUGH_SHARE * peak))
        for portion in _portions(rough + corner, interrupt):
            _pressed(out, portion, *parts, samples)


def _portions(pixels: NDArray[np.intp], interrupt: Interrupt) -> Iterator[NDArray[np.intp]]:
    for start in range(0, len(pixels), _PIXELS_AT_ONCE):
        interrupt()
        yield np.ascontiguousarray(pixels[start : start + _PIXELS_AT_ONCE])


def _is_rough(image: Float64Array, limit: float) -> BoolArray:
    """Return where one ray per pixel is not enough: at edges of walls, shadows and specks."""
    deviation = np.abs(image - uniform_filter(image, size=(3, 3, 1), mode="nearest"))
    return np.asarray(maximum_filter((deviation > limit).any(axis=2), size=3), dtype=np.bool_)


def _seen_window(
    rays: RayTable, surface: PressedSurface, deepest: float
) -> tuple[slice, slice] | None:
    """Return the rows and columns of the pixels whose rays may meet the patch."""
    reach = deepest * float(np.nanmax(np.hypot(rays.slope_x, rays.slope_y))) + surface.pitch_mm
    x, y = surface.x_mm, surface.y_mm
    meets = (rays.x_mm > x[0] - reach) & (rays.x_mm < x[-1] + reach)
    meets &= (rays.y_mm > y[0] - reach) & (rays.y_mm < y[-1] + reach)
    rows, columns = np.flatnonzero(meets.any(axis=1)), np.flatnonzero(meets.any(axis=0))
    if rows.size == 0:
        return None
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
