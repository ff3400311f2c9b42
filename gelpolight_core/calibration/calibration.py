"""A complete, immutable calibration of one sensor: all that a reconstruction needs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.refraction import LayerStack, build_stack
from gelpolight_core.optics.resampling import ResamplingTable, build_resampling_table
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.reflectance.membrane import MEMBRANES, Membrane
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.response.curve import CameraResponse
from gelpolight_core.session.session import SensorData

Array = NDArray[np.float64]
Map = NDArray[np.float32]
MODELS = ("paper", "full")


@dataclass(frozen=True, slots=True)
class HandEdit:
    """A part of a calibration that a person changed by hand.

    Attributes
    ----------
    part : str
        What was changed, such as ``reflectance``.
    channels : tuple of str
        Of ``red``, ``green``, ``blue``.
    made : str
        ISO 8601 time with zone.
    operator : str
        Who did it.
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
        Who made it.
    program_version : str
        Version of the program that made it.
    session : str
        Name of the session folder.
    sources : mapping
        SHA-256 of every file that it was made from, by stage and name.
    camera_settings : mapping
        Exposure and the like, where they are known.
    edits : tuple of HandEdit
        What was changed by hand since, in that order.
    inputs : str
        Changes with anything that the calibration rests on: captures, statements, corrections.
        Empty where nobody noted it.
    """

    created: str
    operator: str
    program_version: str
    session: str
    sources: Mapping[str, str]
    camera_settings: Mapping[str, str] = field(default_factory=dict)
    edits: tuple[HandEdit, ...] = ()
    inputs: str = ""


@dataclass(frozen=True, slots=True)
class ScaleSd:
    """How far all lengths of a calibration may be off by one common share.

    Attributes
    ----------
    depth : float
        Relative standard deviation of depths and slopes, from LEDs, membrane and lateral scale.
    lateral : float
        Relative standard deviation of lengths across, from lens and top surface.
    balls : float
        Relative error of the height of ball presses that are reconstructed, root mean square; it
        is part of `depth`.
    """

    depth: float
    lateral: float
    balls: float = 0.0


@dataclass(frozen=True, slots=True)
class FullModel:
    """What the full model knows beyond the paper's.

    Attributes
    ----------
    led_positions_mm, led_sd_mm : (3, 3)
        Refined on the ball presses, sensor frame, with standard deviations.
    membrane : Membrane
        Its response to light, view and surroundings.
    background : (rows, columns, 3) float32
        The contact-free membrane on the grid, crosstalk removed.
    decay_mm : float
        Decay length of the drape around the balls.
    misfit : float
        Robust relative misfit of the ball presses.
    held_out : tuple of 2 floats
        Mean robust loss on presses held out, with the mirror's LEDs and with the refined ones.
    kept : str
        ``refined`` or ``mirror``: which LEDs `led_positions_mm` holds.
    membrane_sd : mapping
        Standard deviations of what was refined with the LEDs: exponent, gloss, roughness,
        cap_bounce, bounce, decay_mm; 0 for what was held. Empty in files of version 1.
    membrane_held_out : tuple of 2 floats
        The same loss with a two-lobe membrane, and with a one-dimensional one.
    membrane_kept : str
        ``two-lobe`` or ``one-dimensional``: which of them `membrane` is.
    scale_sd : ScaleSd or None
        How sure its lengths are; None in calibrations by programs that did not find out.
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
    """All that is known of one sensor.

    Attributes
    ----------
    sensor : SensorData
        As its maker states it.
    model : str
        The model it was made for: ``paper`` or ``full``.
    camera, plane
        Lens and top surface.
    led_positions_mm : (3, 3)
        Sensor frame, row k is LED k.
    led_covariance_mm2 : (3, 3, 3)
        Covariance of each.
    crosstalk : (3, 3)
        ``I_raw = crosstalk @ I_true``.
    radiance, factors : (rows, columns, 3) float32
        |L| (Eq. 5) and rho (Eq. 9) on the membrane grid; 0 where they are unknown.
    reflectance : ReflectanceTable
        G and R (Eq. 6, 7).
    noise : (3,)
        Standard deviation of a single picture's pixel at its median brightness, per channel.
    quality : mapping
        Quality table of every stage, in their order.
    provenance : Provenance
        When, who, from what.
    full : FullModel or None
        What the full model needs; None where the calibration was made for the paper's alone.
    response : CameraResponse or None
        Of the camera; None where it is linear.
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

    @cached_property
    def stack(self) -> LayerStack:
        """The layers between camera and top surface."""
        return sensor_stack(self.sensor, self.plane)

    @cached_property
    def table(self) -> ResamplingTable:
        """The resampling table, made anew from the optics (it is not stored)."""
        return build_resampling_table(
            self.camera,
            self.plane,
            self.stack,
            working_diameter_mm=self.sensor.working_diameter_mm,
        )

    @cached_property
    def identity(self) -> str:
        """A short name that changes with any number that a reconstruction uses.

        Who made the calibration and when is no part of it: the same pictures have the same name.
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
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        return f"{self.sensor.serial}-{digest.hexdigest()[:12]}"

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        figures = tuple(f for table in self.quality.values() for f in table.figures)
        return QualityTable(figures).verdict


def sensor_stack(sensor: SensorData, plane: TopPlane) -> LayerStack:
    """Return the layers of a sensor below its measured top surface.

    Parameters
    ----------
    sensor : SensorData
        Thicknesses and indices, as its maker states them.
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
