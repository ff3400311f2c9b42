"""The virtual sensor: renders the camera image in each state of a calibration session."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array, PixelArray

from .board_scene import BoardPose, board_image, board_on_top
from .exposure import blurred, exposed, mixed
from .indenters import image_pitch_mm
from .interreflection import FLAT, indirect_light
from .lamps import PointLamp, lamp_table, lamps_of
from .membrane import even_factor, reflectance_factor
from .occlusion import sample_all
from .pressed_surface import PressedSurface
from .rays import camera_points, pixel_directions, project_to_pixels, sensor_axes, trace_pixels
from .sensor_design import SensorDesign, validate_design
from .shading import (
    IndirectLight,
    SurfaceMaterial,
    flat_brightness,
    lose_on_camera_rays,
    shade_pressed,
)
from .simulation_kernel import Interrupt, never_interrupt

FactorGrid = tuple[Float64Array, float, float, float]
"""Reflectance factor over the membrane, as :func:`reflectance_factor` returns it."""


@dataclass(frozen=True, slots=True)
class Checkerboard:
    """A checkerboard held in front of the camera, before anything is mounted."""

    pose: BoardPose


@dataclass(frozen=True, slots=True)
class BoardOnTop:
    """The small checkerboard on the sensor's top surface, before the elastomer is mounted."""


@dataclass(frozen=True, slots=True)
class Mirror:
    """A flat mirror on the sensor's top surface, before the elastomer is mounted."""


@dataclass(frozen=True, slots=True)
class Whiteboard:
    """The diffuse standard pressed onto the bare elastomer.

    It is flat, so it lights itself only by the lower face of the layers, and only if the design has
    interreflection.

    Attributes
    ----------
    exposure : float
        Exposure relative to the images of the membrane.
    led : int or None
        The only LED that is on; None for all.
    """

    exposure: float = 1.0
    led: int | None = None


@dataclass(frozen=True, slots=True)
class BareMembrane:
    """The finished sensor without contact."""


@dataclass(frozen=True, slots=True)
class PressedMembrane:
    """The finished sensor with an object pressed into it."""

    surface: PressedSurface


SensorState = Checkerboard | BoardOnTop | Mirror | Whiteboard | BareMembrane | PressedMembrane


class VirtualSensor:
    """A sensor built from a design.

    Parameters
    ----------
    design : SensorDesign
        The design.
    seed : int, optional
        Seed of the membrane's pattern and of the noise; the same seed gives the same sequence of
        bytes.
    lamps : tuple of PointLamp, optional
        Lights that replace the design's three LEDs.
    interrupt : callable, optional
        Called regularly during construction; an exception raised by it stops the work.

    Raises
    ------
    InputError
        If the parts of the design do not fit together (see :func:`validate_design`).
    """

    def __init__(
        self,
        design: SensorDesign,
        seed: int = 0,
        *,
        lamps: tuple[PointLamp, ...] | None = None,
        interrupt: Interrupt = never_interrupt,
    ) -> None:
        self.design = validate_design(design)
        self.seed = seed
        self.lamps = lamps_of(design) if lamps is None else lamps
        self.material = SurfaceMaterial.of_membrane(design.membrane)
        apex, layers = design.membrane.apex_height_mm, design.layers
        # Rays, lamps and depths are those from the plane of the apex, so that no depth is negative,
        # and from the membrane's axis.
        self._table = lamp_table(self.lamps, axis_mm=design.membrane.axis_mm, apex_height_mm=apex)
        self._lit = replace(
            design,
            layers=replace(
                layers,
                top_distance_mm=layers.top_distance_mm + apex,
                elastomer_thickness_mm=layers.elastomer_thickness_mm + apex,
            ),
        )
        self._bare = replace(FLAT, pitch_mm=image_pitch_mm(design)).on(design.membrane)
        self._count = 0
        rays = trace_pixels(design.camera, self._lit.layers, interrupt=interrupt)
        x, y = design.membrane.axis_mm
        self.rays = replace(rays, x_mm=rays.x_mm - x, y_mm=rays.y_mm - y)
        self._even = even_factor(design.membrane)
        self.factors = reflectance_factor(
            design.membrane, np.random.default_rng([seed, zlib.crc32(b"membrane")])
        )
        interrupt()
        self._board = SurfaceMaterial(design.photometry.whiteboard_reflectance)
        self._board_light = indirect_light(
            self._lit, self._table, self._bare, self._even, self._board, interrupt=interrupt
        )
        self.exposure = self._exposure(interrupt)
        interrupt()
        self._cover = self._rim_cover()
        indirect = self._membrane_light(self._bare, interrupt)
        self._membrane = self._at_rest(self.material, self.factors, indirect, interrupt)

    def brightness(
        self, state: SensorState, *, samples: int = 3, interrupt: Interrupt = never_interrupt
    ) -> Float64Array:
        """Return the exact image (rows, columns, 3), linear, before noise and saturation.

        Parameters
        ----------
        state : SensorState
            Scene in front of the camera.
        samples : int, optional
            Rays per pixel and side at the edges of the pressed object; 1 is fastest.
        interrupt : callable, optional
            Called regularly; an exception raised by it stops the work.
        """
        camera, photometry = self.design.camera, self.design.photometry
        if isinstance(state, (Checkerboard, BoardOnTop)):
            pose = state.pose if isinstance(state, Checkerboard) else self.top_pose
            grey = board_image(camera, pose, interrupt=interrupt)
            return np.repeat(blurred(grey, camera.blur_sigma_px)[..., None], 3, axis=2)
        if isinstance(state, Mirror):
            light = self._mirror() * photometry.mirror_peak
        elif isinstance(state, Whiteboard):
            light = self._at_rest(self._board, self._even, self._board_light, interrupt)
            light *= self.exposure * state.exposure
            if state.led is not None:
                light[..., np.arange(light.shape[2]) != state.led] = 0.0
        else:
            light = self._membrane.copy()
            if isinstance(state, PressedMembrane):
                surface = state.surface.on(self.design.membrane)
                indirect = self._membrane_light(surface, interrupt)
                if self.design.membrane.bounces > 0:
                    light = self._flat(self.material, self.factors, indirect)
                shade_pressed(
                    light,
                    self.rays,
                    surface,
                    self.factors,
                    self._table,
                    self.material,
                    indirect,
                    samples=samples,
                    interrupt=interrupt,
                )
            interrupt()
            light *= self.exposure
        return blurred(mixed(light, photometry.crosstalk), camera.blur_sigma_px)

    def frame(
        self, state: SensorState, *, averaged: int = 1, stream: str | None = None
    ) -> PixelArray:
        """Return the camera image, (rows, columns, 3) in RGB order.

        Parameters
        ----------
        state : SensorState
            Scene in front of the camera.
        averaged : int, optional
            Number of averaged frames.
        stream : str, optional
            Name of the noise; the same name gives the same noise. Without a name, each call gives
            the next noise of the sensor's sequence.
        """
        if stream is None:
            self._count += 1
            key = [self.seed, 0, self._count]
        else:
            key = [self.seed, 1, zlib.crc32(stream.encode())]
        image = self.brightness(state)
        rng = np.random.default_rng(key)
        if isinstance(state, (Checkerboard, BoardOnTop)):
            grey = exposed(image[..., 0], self.design.camera, rng, averaged=averaged)
            return np.asarray(np.repeat(grey[..., None], 3, axis=2))
        return exposed(image, self.design.camera, rng, averaged=averaged)

    @property
    def top_pose(self) -> BoardPose:
        """Pose of the small checkerboard on the top surface."""
        membrane = self.design.membrane
        return board_on_top(
            self.design.layers,
            working_diameter_mm=membrane.working_diameter_mm,
            axis_mm=membrane.axis_mm,
        )

    def _membrane_light(self, surface: PressedSurface, interrupt: Interrupt) -> IndirectLight:
        return indirect_light(
            self._lit, self._table, surface, self.factors, self.material, interrupt=interrupt
        )

    def _at_rest(
        self,
        material: SurfaceMaterial,
        factors: FactorGrid,
        indirect: IndirectLight,
        interrupt: Interrupt,
    ) -> Float64Array:
        """Brightness of the surface at rest at each pixel, before exposure."""
        light = self._flat(material, factors, indirect)
        shade_pressed(
            light,
            self.rays,
            self._bare,
            factors,
            self._table,
            material,
            indirect,
            interrupt=interrupt,
        )
        return light

    def _flat(
        self, material: SurfaceMaterial, factors: FactorGrid, indirect: IndirectLight
    ) -> Float64Array:
        """Brightness of a flat surface in the plane of the apex, before exposure."""
        light = flat_brightness(self.rays, self._table, material)
        indirect.add_flat(light, self.rays)
        lose_on_camera_rays(light, self.rays, self._table, self._cover)
        return np.nan_to_num(light) * self._factor_seen(factors)[..., None]

    def _rim_cover(self) -> Float64Array:
        """Share of each pixel that lies inside the working circle."""
        rays, rim = self.rays, 0.5 * self.design.membrane.working_diameter_mm
        radius = np.hypot(rays.x_mm, rays.y_mm)
        pixel = np.hypot(*np.gradient(radius))
        cover = np.clip((rim - radius) / np.maximum(pixel, 1e-9) + 0.5, 0.0, 1.0)
        return np.asarray(np.nan_to_num(cover))

    def _factor_seen(self, factors: FactorGrid) -> Float64Array:
        factor, first, pitch, _ = factors
        rays = self.rays
        column, row = (rays.x_mm - first) / pitch, (rays.y_mm - first) / pitch
        return sample_all(factor, np.asarray(column), np.asarray(row))

    def _exposure(self, interrupt: Interrupt) -> float:
        """Exposure at which the brightest point of the whiteboard image has the stated peak.

        A curved membrane is thought to be covered by the white of the board.
        """
        photometry = self.design.photometry
        rim = 0.5 * self.design.membrane.working_diameter_mm
        rays = self.rays
        light = flat_brightness(rays, self._table, self._board)
        self._board_light.add_flat(light, rays)
        lose_on_camera_rays(light, rays, self._table)
        shade_pressed(
            light,
            rays,
            self._bare,
            self._even,
            self._table,
            self._board,
            self._board_light,
            samples=1,
            interrupt=interrupt,
        )
        inside = np.hypot(rays.x_mm, rays.y_mm) <= rim
        channels = mixed(light[inside], photometry.crosstalk)
        peak = float(channels.max(initial=0.0))
        return photometry.whiteboard_peak / peak if peak > 0.0 else 1.0

    def _mirror(self) -> Float64Array:
        """Image of the mirrored lamps, with brightness 1 for an emitting disc of power 1."""
        camera, layers = self.design.camera, self.design.layers
        out = np.zeros((camera.height_px, camera.width_px, len(self.lamps)))
        rim = 0.5 * self.design.membrane.working_diameter_mm
        for k, lamp in enumerate(self.lamps):
            twin = camera_points(layers, np.array([lamp.x_mm, lamp.y_mm, lamp.height_mm]))
            u, v = project_to_pixels(camera, twin)
            reach = 2 + math.ceil(camera.fx * lamp.diameter_mm / twin[2])
            i0, j0 = max(0, round(v) - reach), max(0, round(u) - reach)
            i1 = min(camera.height_px, round(v) + reach + 1)
            j1 = min(camera.width_px, round(u) + reach + 1)
            if i0 < i1 and j0 < j1:
                out[i0:i1, j0:j1, k] = lamp.power * self._disc_share(lamp, (i0, i1, j0, j1), rim)
        strongest = max((p.power for p in self.lamps), default=1.0)
        return out / max(strongest, 1e-12)

    def _disc_share(
        self, lamp: PointLamp, window: tuple[int, int, int, int], rim: float
    ) -> Float64Array:
        """Share of each pixel of a window that shows the mirror image of a lamp's disc."""
        layers, n = self.design.layers, 8
        i0, i1, j0, j1 = window
        v = i0 - 0.5 + (np.arange((i1 - i0) * n) + 0.5) / n
        u = j0 - 0.5 + (np.arange((j1 - j0) * n) + 0.5) / n
        directions = pixel_directions(self.design.camera, *np.meshgrid(u, v))
        ray = directions @ sensor_axes(layers).T
        slope_x, slope_y = ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2]
        total = layers.top_distance_mm + lamp.height_mm
        hit = np.hypot(slope_x * total - lamp.x_mm, slope_y * total - lamp.y_mm)
        mirror_distance, (x, y) = layers.top_distance_mm, self.design.membrane.axis_mm
        on_mirror = np.hypot(slope_x * mirror_distance - x, slope_y * mirror_distance - y) <= rim
        share = ((hit <= 0.5 * lamp.diameter_mm) & on_mirror).astype(np.float64)
        return np.asarray(share.reshape(i1 - i0, n, j1 - j0, n).mean(axis=(1, 3)))
