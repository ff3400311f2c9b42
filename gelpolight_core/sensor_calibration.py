"""A complete, immutable calibration of one sensor: everything that a reconstruction needs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import BadPixels, no_bad_pixels
from gelpolight_core.finding import QualityTable, Verdict, failure, worst_verdict
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.refraction import LayerStack, build_stack
from gelpolight_core.optics.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.reflectance.membrane import MEMBRANES, Membrane
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.session.session import SensorData

Array = NDArray[np.float64]
Map = NDArray[np.float32]
MODELS = ("paper", "full")


@dataclass(frozen=True, slots=True)
class HandEdit:
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
    """Where a calibration comes from.

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
    edits : tuple of HandEdit
        Later edits by hand, in their order.
    inputs : str
        Hash of all inputs of the calibration: captures, stated values, corrections. Empty if not
        recorded.
    elastomer : str
        Name or serial number of the elastomer. Empty if not stated.
    accepted : str
        Why this calibration is used although it failed. Empty if nobody said so.
    """

    created: str
    operator: str
    program_version: str
    session: str
    sources: Mapping[str, str]
    camera_settings: Mapping[str, str] = field(default_factory=dict)
    edits: tuple[HandEdit, ...] = ()
    inputs: str = ""
    elastomer: str = ""
    accepted: str = ""


@dataclass(frozen=True, slots=True)
class ScaleSd:
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
    """

    depth: float
    lateral: float
    balls: float = 0.0


@dataclass(frozen=True, slots=True)
class FullModel:
    """Data of the full model beyond the paper's model.

    Attributes
    ----------
    led_positions_mm, led_sd_mm : (3, 3)
        Refined on the ball presses, sensor frame, with standard deviations.
    membrane : Membrane
        Response of the membrane to light, view and surroundings.
    background : (rows, columns, 3) float32
        The contact-free membrane on the grid, crosstalk removed.
    decay_mm : float
        Decay length of the drape around the balls.
    misfit : float
        Robust relative misfit of the ball presses.
    held_out : tuple of 2 floats
        Mean robust loss on presses held out, with the LEDs from the mirror and with the refined
        ones.
    kept : str
        ``refined`` or ``mirror``: which LEDs `led_positions_mm` holds.
    membrane_sd : mapping
        Standard deviations of the parameters refined with the LEDs: exponent, gloss, roughness,
        interreflection, decay_mm; 0 for fixed parameters. Empty in files of version 1.
    membrane_held_out : tuple of 2 floats
        The same loss with a two-lobe membrane, and with a one-dimensional one.
    membrane_kept : str
        ``two-lobe`` or ``one-dimensional``: the form of `membrane`.
    scale_sd : ScaleSd or None
        Uncertainty of the lengths; None in calibrations by programs that did not estimate it.
    """

    led_positions_mm: Array
    led_sd_mm: Array
    membrane: Membrane
    background: Map
    decay_mm: float
    misfit: float
    held_out: tuple[float, float]
    kept: str
    membrane_sd: Mapping[str, float] = field(default_factory=dict)
    membrane_held_out: tuple[float, float] = (0.0, 0.0)
    membrane_kept: str = MEMBRANES[0]
    scale_sd: ScaleSd | None = None


@dataclass(frozen=True)
class Calibration:
    """All calibrated data of one sensor.

    Attributes
    ----------
    sensor : SensorData
        Data stated by the maker.
    model : str
        The model it was made for: ``paper`` or ``full``.
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
    quality : mapping
        Quality table of every stage, in order.
    provenance : Provenance
        Origin of the calibration.
    full : FullModel or None
        Data of the full model; None if the calibration was made for the paper's model only.
    response : CameraResponse or None
        Of the camera; None where it is linear.
    bad : BadPixels or None
        Dead and hot pixels of the camera, which every solve leaves out; None where there are none,
        and in calibrations by programs that did not look for them.
    lens_blur_px : float or None
        Standard deviation of the blur of lens and pixel on the top surface, in raw pixels; None in
        calibrations by programs that did not measure it.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> calibration = gp.read_calibration("sensor.gplcal")
    >>> calibration.led_positions_mm.shape
    (3, 3)
    """

    sensor: SensorData
    model: str
    camera: Camera
    plane: TopPlane
    led_positions_mm: Array
    led_covariance_mm2: Array
    crosstalk: Array
    radiance: Map
    factors: Map
    reflectance: ReflectanceTable
    noise: Array
    quality: Mapping[str, QualityTable]
    provenance: Provenance
    full: FullModel | None = None
    response: CameraResponse | None = None
    bad: BadPixels | None = None
    lens_blur_px: float | None = None

    @cached_property
    def bad_pixels(self) -> BadPixels:
        """Dead and hot pixels of the camera."""
        return self.bad or no_bad_pixels(self.camera.height, self.camera.width)

    @cached_property
    def stack(self) -> LayerStack:
        """The layers between camera and top surface."""
        return sensor_stack(self.sensor, self.plane)

    @cached_property
    def table(self) -> ResamplingTable:
        """The resampling table, recomputed from the optics (it is not stored)."""
        return build_resampling_table(
            self.camera,
            self.plane,
            self.stack,
            working_diameter_mm=self.sensor.working_diameter_mm,
        )

    @cached_property
    def identity(self) -> str:
        """A short name that changes with any number that a reconstruction uses.

        Operator and time are not included: the same images give the same name.
        """
        digest = hashlib.sha256(repr((self.sensor, self.model, self.camera, self.plane)).encode())
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
            digest.update(repr((full.membrane, full.kept, full.decay_mm, full.misfit)).encode())
            arrays += [full.led_positions_mm, full.led_sd_mm, full.background]
        if self.response is not None:
            arrays.append(self.response.curves)
        if self.bad is not None:
            arrays.append(self.bad.pixels)
        if self.lens_blur_px is not None:
            digest.update(repr(self.lens_blur_px).encode())
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        return f"{self.sensor.serial}-{digest.hexdigest()[:12]}"

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        return worst_verdict(self.quality)

    @property
    def fault(self) -> str:
        """Why no measurement with it is reliable, as a clause; empty if it did not fail.

        A calibration with warnings is within the limits in which its stated uncertainties hold.
        """
        return failure(self.quality)


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
