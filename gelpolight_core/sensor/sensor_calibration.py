"""A complete, immutable calibration of one sensor: everything that a reconstruction needs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    calibration_fault,
    join_quality_tables,
)
from gelpolight_core.base.identity import identity_text
from gelpolight_core.base.membrane_masks import saturated_mask
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.length_tolerances import stated_sd
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.geometry.refraction import LayerStack, build_stack, membrane_to_camera
from gelpolight_core.geometry.resampling import (
    ResamplingTable,
    build_resampling_table,
    visible_grid,
)
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.health.background_reference import BackgroundReference, HasImageSize
from gelpolight_core.image.bad_pixels import BadPixels, no_bad_pixels
from gelpolight_core.image.grain import Grain
from gelpolight_core.image.image_file import MAX_PIXELS
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.light.directions import flat_cosines
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.reflectance_table import ReflectanceTable
from gelpolight_core.sensor.length_errors import LengthErrors
from gelpolight_core.session.session import SensorData
from gelpolight_core.session.validation import Validation
from gelpolight_core.stages.flat_field.factor_map import LEAST_FACTOR
from gelpolight_core.stages.flat_field.whiteboard_stage import LEAST_LIGHT
from gelpolight_core.stages.leds.crosstalk import unmix

MODELS = ("paper", "full")
MOST_CROSSTALK = 100.0
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class ManualEdit:
    """A part of a calibration that was edited by hand.

    Attributes
    ----------
    part : str
        What was edited, such as ``reflectance``.
    channels : tuple of str
        Any of ``red``, ``green``, ``blue``.
    made : str
        ISO 8601 time with zone.
    operator : str
        Name of the user who edited it.
    """

    part: str
    channels: tuple[str, ...]
    made: str
    operator: str


@dataclass(frozen=True, slots=True)
class Provenance:
    """Origin of a calibration: session, operator, program and sources.

    Attributes
    ----------
    created : str
        ISO 8601 time with zone.
    operator : str
        Name of the user who made it.
    program_version : str
        Version of the program that made it.
    session : str
        Name of the session folder.
    sources : mapping
        SHA-256 of every source file, by stage and name.
    camera_settings : mapping
        Exposure and similar settings, if known.
    edits : tuple of ManualEdit
        Later edits by hand, in their order.
    inputs : str
        Hash of all inputs of the calibration: captures, stated values, corrections. Empty if not
        recorded.
    accepted : str
        Why this calibration is used although it failed. Empty if no reason was stated.
    """

    created: str
    operator: str
    program_version: str
    session: str
    sources: Mapping[str, str]
    camera_settings: Mapping[str, str] = field(default_factory=dict)
    edits: tuple[ManualEdit, ...] = ()
    inputs: str = ""
    accepted: str = ""


@dataclass(frozen=True, slots=True)
class ScaleUncertainty:
    """Common relative error of all lengths of a calibration.

    Attributes
    ----------
    depth : float
        Relative standard deviation of depths and slopes, from LEDs, membrane and lateral scale.
    lateral : float
        Relative standard deviation of lateral lengths, from lens and top surface.
    balls : float
        Relative error of the height of reconstructed ball presses, root mean square; it is part of
        `depth`.
    shown : tuple of 2 floats, or None
        How much larger than stated all balls look, relative, with its standard deviation; None
        where the presses do not show it.
    """

    depth: float
    lateral: float
    balls: float = 0.0
    shown: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class FullModel:
    """Data of the full model beyond the paper's model.

    Attributes
    ----------
    led_positions_mm, led_sd_mm : (3, 3)
        Refined on the ball presses, sensor frame, with standard deviations.
    membrane : MembraneBrdf
        Response of the membrane to light, view and surroundings.
    background : (rows, columns, 3) float32
        The contact-free membrane on the grid, crosstalk removed.
    decay_mm : float
        Decay length of the drape around the balls.
    misfit : float
        Robust relative misfit of the ball presses.
    kept : str
        ``refined`` or ``mirror``: which LEDs `led_positions_mm` holds.
    membrane_sd : mapping
        Standard deviations of the parameters refined with the LEDs, by their names: those of the
        terms in use, and the decay length. Empty in files of version 1.
    worth : mapping
        For each term that was tried, by its key: by which share of the untouched membrane's light
        the calculated light of the ball presses changes (rms) if only this term is left out, or
        added, and all else is fitted again.
    scale_sd : ScaleUncertainty or None
        Uncertainty of the lengths; None in calibrations by programs that did not estimate it.
    older_reach_mm : float or None
        Reach of the interreflection as earlier programs described it. Only the identity uses it.
    """

    led_positions_mm: Float64Array
    led_sd_mm: Float64Array
    membrane: MembraneBrdf
    background: Float32Array
    decay_mm: float
    misfit: float
    kept: str
    membrane_sd: Mapping[str, float] = field(default_factory=dict)
    worth: Mapping[str, float] = field(default_factory=dict)
    scale_sd: ScaleUncertainty | None = None
    older_reach_mm: float | None = None

    def check(self) -> None:
        """Refuse impossible values.

        Raises
        ------
        ValueError
            With the first of them.
        """
        self.membrane.check()
        figures = [self.misfit, *self.membrane_sd.values(), *self.worth.values()]
        if self.scale_sd is not None:
            figures += [self.scale_sd.depth, self.scale_sd.lateral, self.scale_sd.balls]
        if min(figures) < 0.0 or self.decay_mm <= 0.0:
            raise ValueError("the figures of the joint refinement are impossible")
        if self.kept not in ("refined", "mirror"):
            raise ValueError("the choice of the joint refinement is unknown")

    @property
    def membrane_text(self) -> str:
        """Text of the membrane in the identity."""
        if self.older_reach_mm is None:
            return identity_text(self.membrane)
        m = self.membrane
        return (
            f"Membrane(exponent={m.exponent!r}, gloss={m.gloss!r}, roughness={m.roughness!r}, "
            f"bounce={m.interreflection!r}, bounce_reach_mm={self.older_reach_mm!r}, "
            f"diffuse={m.diffuse!r})"
        )


class SensorModel(BackgroundReference, Protocol):
    """The calibrated data of a kind of sensor, with what every user of a calibration needs."""

    @property
    def serial(self) -> str:
        """Serial number of the sensor."""

    @property
    def bad_pixels(self) -> BadPixels:
        """Dead and hot pixels of the camera."""

    def with_background(self, present: Float32Array) -> SensorModel:
        """Return the data with another image of the untouched membrane, on the grid."""

    def on_grid(self, rgb: Float32Array) -> Float32Array:
        """Return a camera image (height, width, 3) on the grid (rows, columns, 3)."""

    def digest(self, model: str) -> bytes:
        """Return a hash that changes with any number that a reconstruction uses."""

    def check(self) -> None:
        """Refuse impossible values with ValueError."""

    def to_pixels(self, points_mm: Float64Array) -> Float64Array:
        """Return the camera pixels (N, 2) that see points (N, 2) of the undeformed membrane."""

    @property
    def length_errors(self) -> LengthErrors | None:
        """Errors of lengths; None if the calibration does not state them."""

    @property
    def leds_mm(self) -> Float64Array:
        """Positions (N, 3) of the LEDs as calibrated at last, none if they are not known."""


@dataclass(frozen=True)
class OpenSensor:
    """Optics, lights and membrane of a sensor that can be opened.

    Attributes
    ----------
    sensor : SensorData
        Data stated by the maker.
    camera, plane
        Lens and top surface.
    led_positions_mm : (3, 3)
        Sensor frame, row k is LED k.
    led_covariance_mm2 : (3, 3, 3)
        Covariance of each position.
    crosstalk : (3, 3)
        ``I_raw = crosstalk @ I_true``.
    radiance, factors : (rows, columns, 3) float32
        |L| (Eq. 5) and rho (Eq. 9) on the membrane grid; 0 where unknown.
    reflectance : ReflectanceTable
        G and R (Eq. 6, 7).
    noise : (3,)
        Standard deviation of a pixel of a single image at median brightness, per channel.
    full : FullModel or None
        Data of the full model; None if the calibration was made for the paper's model only.
    response : CameraResponse or None
        Inverse camera response, or None for a linear camera.
    bad : BadPixels or None
        Dead and hot pixels of the camera, which every solve leaves out; None where there are none,
        and in calibrations by programs that did not look for them.
    lens_blur_px : float or None
        Standard deviation of the blur of lens and pixel on the top surface, in raw pixels; None in
        calibrations by programs that did not measure it.
    grain : Grain or None
        Grain of the ball presses' images; None in calibrations by programs that did not measure it.
    shape : MembraneShape or None
        The undeformed membrane; None: flat.

    Raises
    ------
    ValueError
        If a value is impossible, or the maps do not fit the optics.
    """

    sensor: SensorData
    camera: CameraModel
    plane: TopPlane
    led_positions_mm: Float64Array
    led_covariance_mm2: Float64Array
    crosstalk: Float64Array
    radiance: Float32Array
    factors: Float32Array
    reflectance: ReflectanceTable
    noise: Float64Array
    full: FullModel | None = None
    response: CameraResponse | None = None
    bad: BadPixels | None = None
    lens_blur_px: float | None = None
    grain: Grain | None = None
    shape: MembraneShape | None = None

    @property
    def surface(self) -> MembraneShape:
        """The undeformed membrane."""
        return self.shape or FLAT

    @property
    def serial(self) -> str:
        """Serial number of the sensor."""
        return self.sensor.serial

    @cached_property
    def bad_pixels(self) -> BadPixels:
        """Dead and hot pixels of the camera."""
        return self.bad or no_bad_pixels(self.camera.height, self.camera.width)

    @cached_property
    def stack(self) -> LayerStack:
        """The layers between camera and top surface."""
        return sensor_stack(self.sensor, self.plane)

    @cached_property
    def length_errors(self) -> LengthErrors | None:
        """Errors of lengths by calibration and stated lengths; None without them."""
        if self.full is None or (scale := self.full.scale_sd) is None:
            return None
        stated = stated_sd(self.stack, scale.shown)
        depth, lateral = (
            math.hypot(scale.depth, stated.depth),
            math.hypot(scale.lateral, stated.lateral),
        )
        return LengthErrors(depth, lateral, self.table.grid.pitch_mm, self.full.decay_mm)

    @property
    def leds_mm(self) -> Float64Array:
        """Positions (3, 3) of the LEDs: refined, or of the mirror."""
        return (self.full or self).led_positions_mm

    @cached_property
    def table(self) -> ResamplingTable:
        """The resampling table, recomputed from the optics (it is not stored)."""
        return build_resampling_table(
            self.camera,
            self.plane,
            self.stack,
            working_diameter_mm=self.sensor.working_diameter_mm,
            surface=self.surface,
        )

    @property
    def background(self) -> Float32Array:
        """The untouched membrane as the camera sees it, linear light on the grid, 0 if unknown."""
        if self.full is None:
            return np.asarray(self.factors * self._even_membrane, np.float32)
        mixed = np.minimum(self.full.background @ self.crosstalk.T, 1.0)
        return np.asarray(np.where(self.table.valid[..., None], mixed, 0.0), np.float32)

    @property
    def _even_membrane(self) -> Float64Array:
        """Image of a uniform flat membrane (I_t of Eq. 9), (rows, columns, 3)."""
        cosines = flat_cosines(self.table, self.led_positions_mm)
        response = [self.reflectance.response(k, cosines[..., k]) for k in range(3)]
        return np.asarray(self.radiance * np.stack(response, axis=-1))

    def with_background(self, present: Float32Array) -> OpenSensor:
        """Return the data with another image of the untouched membrane, on the grid.

        The reflectance factors (Eq. 9) follow from it; they are 0 where they are unknown.
        """
        theory = self._even_membrane
        factors = np.zeros(present.shape, np.float32)
        np.divide(present, theory, out=factors, where=theory > 0.0, casting="same_kind")
        known_mask = (factors > LEAST_FACTOR).all(axis=2) & np.isfinite(factors).all(axis=2)
        # The same limit as for the white board: dim areas are left out.
        light = self.radiance * flat_cosines(self.table, self.led_positions_mm)
        known_mask &= ~saturated_mask(present).any(axis=2) & (light > LEAST_LIGHT).all(axis=2)
        factors[~known_mask] = 0.0
        full = self.full
        if full is not None:
            full = replace(full, background=unmix(present, self.crosstalk))
        return replace(self, factors=factors, full=full)

    def on_grid(self, rgb: Float32Array) -> Float32Array:
        """Return a camera image (height, width, 3) on the grid (rows, columns, 3)."""
        return self.table.apply(rgb)

    def digest(self, model: str) -> bytes:
        """Return a hash that changes with any number that a reconstruction uses."""
        hashed = hashlib.sha256(
            identity_text((self.sensor, model, self.camera, self.plane)).encode()
        )
        arrays = [
            self.led_positions_mm,
            self.led_covariance_mm2,
            self.crosstalk,
            self.radiance,
            self.factors,
            self.noise,
            *self.reflectance.cosines,
            *self.reflectance.values,
            self.reflectance.coverage,
        ]
        if self.full is not None:
            full = self.full
            figures = repr((full.kept, full.decay_mm, full.misfit))
            hashed.update(f"({full.membrane_text}, {figures[1:]}".encode())
            if full.membrane.terms:
                hashed.update(repr(sorted(full.membrane.terms.items())).encode())
            arrays += [full.led_positions_mm, full.led_sd_mm, full.background]
        if self.response is not None:
            arrays.append(self.response.curves)
        if self.bad is not None:
            arrays.append(self.bad.pixels)
        if self.lens_blur_px is not None:
            hashed.update(repr(self.lens_blur_px).encode())
        if self.shape is not None:
            hashed.update(identity_text(self.shape).encode())
        for array in arrays:
            hashed.update(np.ascontiguousarray(array).tobytes())
        return hashed.digest()

    def check(self) -> None:
        """Refuse impossible values, and maps that do not fit the optics.

        Raises
        ------
        ValueError
            With the first of them.
        """
        camera, diameter_mm = self.camera, self.sensor.working_diameter_mm
        grid = visible_grid(camera, self.plane, self.stack, diameter_mm=diameter_mm)
        lengths = camera.width, camera.height, camera.fx, camera.fy, self.plane.distance_mm
        if min(lengths) <= 0 or camera.width * camera.height > MAX_PIXELS:
            raise ValueError("camera or plane have impossible values")
        if abs(float(np.linalg.norm(self.plane.normal_camera)) - 1.0) > ROUNDING:
            raise ValueError("the normal of the plane does not have length 1")
        if self.lens_blur_px is not None and not 0.0 < self.lens_blur_px < min(lengths[:2]):
            raise ValueError(f"the blur of the lens is {self.lens_blur_px} pixels")
        if self.bad is not None and (self.bad.width, self.bad.height) != lengths[:2]:
            raise ValueError("the bad pixels are of another image size")
        self.reflectance.check()
        self.surface.check()
        shapes: list[tuple[NDArray[Any], tuple[int, ...]]] = [
            (self.led_positions_mm, (3, 3)),
            (self.led_covariance_mm2, (3, 3, 3)),
            (self.crosstalk, (3, 3)),
            (self.noise, (3,)),
            (self.radiance, (*grid.shape, 3)),
            (self.factors, (*grid.shape, 3)),
        ]
        if self.full is not None:
            self.full.check()
            shapes += [
                (self.full.led_positions_mm, (3, 3)),
                (self.full.led_sd_mm, (3, 3)),
                (self.full.background, (*grid.shape, 3)),
            ]
            # Removing crosstalk leaves noise around zero where the background is dark.
            if float(self.full.background.min()) < -float(self.full.background.max()):
                raise ValueError("the background has impossible values")
        if any(array.shape != shape for array, shape in shapes):
            raise ValueError("an array does not fit the optics")
        if not np.linalg.cond(self.crosstalk) < MOST_CROSSTALK:
            raise ValueError("the crosstalk matrix cannot be inverted")
        if min(float(self.radiance.min()), float(self.factors.min())) < 0.0:
            raise ValueError("radiance or factors are negative")

    def to_pixels(self, points_mm: Float64Array) -> Float64Array:
        """Return the camera pixels (N, 2) that see points (N, 2) of the undeformed membrane."""
        points = np.asarray(points_mm, float)
        directions = membrane_to_camera(points, self.plane, self.stack, self.surface)
        return np.asarray(self.camera.project(directions))


K = TypeVar("K")


@dataclass(frozen=True)
class Calibration:
    """All calibrated data of one sensor.

    Attributes
    ----------
    model : str
        The model that it was made for: ``paper``, ``full`` or ``in-place``.
    data : SensorModel
        What was calibrated: an :class:`OpenSensor`, or the in-place model of a closed sensor.
    quality : mapping
        Quality table of every stage, in order.
    provenance : Provenance
        Origin of the calibration.
    validation : Validation or None
        On an object of known size, passed or not.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> calibration = gp.read_calibration("sensor.gplcal")
    >>> calibration.model
    'full'
    >>> calibration.table.grid.pitch_mm < 0.2
    True
    """

    model: str
    data: SensorModel
    quality: Mapping[str, QualityTable]
    provenance: Provenance
    validation: Validation | None = None

    @property
    def serial(self) -> str:
        """Serial number of the sensor."""
        return self.data.serial

    @property
    def camera(self) -> HasImageSize:
        """The camera, or at least the size of its images."""
        return self.data.camera

    @property
    def noise(self) -> Float64Array:
        """Standard deviation (3,) of a pixel of a single image at median brightness."""
        return self.data.noise

    @property
    def response(self) -> CameraResponse | None:
        """Inverse camera response, or None for a linear camera."""
        return self.data.response

    @property
    def table(self) -> ResamplingTable:
        """The camera pixel of each node of the membrane grid."""
        return self.data.table

    @property
    def loss(self) -> float:
        """Loss by compression of its image files, in grey levels of 8 bit (0 without)."""
        files = {f.key: f.value for f in self.quality.get("files", QualityTable()).figures}
        return files.get("compression_grey_levels", 0.0)

    @property
    def open_sensor(self) -> OpenSensor:
        """Optics, lights and membrane.

        Raises
        ------
        InputError
            If they are unknown, because the calibration was made in place.
        """
        return self.data_of(OpenSensor)

    def data_of(self, kind: type[K]) -> K:
        """Return the data for work that needs this kind of them.

        Raises
        ------
        InputError
            If the calibration is of another kind of sensor.
        """
        if not isinstance(self.data, kind):
            text = f"The calibration is of another kind of sensor (model {self.model})"
            raise InputError(text, self.identity, Remedy.OTHER_MODEL)
        return self.data

    def changed(self, **values: Any) -> Calibration:
        """Return a copy of the calibration with other values of its data."""
        data: Any = self.data
        return replace(self, data=replace(data, **values))

    @cached_property
    def identity(self) -> str:
        """A short name that changes with any number that a reconstruction uses.

        Operator and time are not included: the same images give the same name.
        """
        return f"{self.serial}-{self.data.digest(self.model).hex()[:12]}"

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        return join_quality_tables(self.quality.values()).verdict

    @property
    def fault(self) -> Finding | None:
        """Why no measurement with it is reliable, or None if it did not fail.

        A calibration with warnings is within the limits in which its stated uncertainties hold.
        """
        return calibration_fault(self.quality)


def sensor_stack(sensor: SensorData, plane: TopPlane) -> LayerStack:
    """Return the layers of a sensor below its measured top surface.

    Parameters
    ----------
    sensor : SensorData
        Thicknesses and indices stated by the maker.
    plane : TopPlane
        The top surface.

    Raises
    ------
    InputError
        If the layers are thicker than the distance to the camera.
    """
    return build_stack(
        plane.distance_mm,
        elastomer_thickness_mm=sensor.elastomer_thickness_mm,
        elastomer_index=sensor.elastomer_refractive_index,
        window_thickness_mm=sensor.window_thickness_mm,
        window_index=sensor.window_refractive_index,
    )
