"""A virtual sensor with the exact calibration.

Nothing is calibrated from images: lens, pose, LEDs, crosstalk and light are those of the design.
All errors are therefore those of the reconstruction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.version import __version__
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.geometry.resampling import build_resampling_table
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.lab.depth_score import TrueDepth
from gelpolight_core.light.coating_stretch import STRETCH
from gelpolight_core.light.directions import flat_cosines
from gelpolight_core.light.gel_absorption import ABSORPTION
from gelpolight_core.light.led_lobe import LOBE
from gelpolight_core.light.light_term import LightTerm
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.reflectance_table import cosine_table
from gelpolight_core.sensor.sensor_calibration import (
    Calibration,
    FullModel,
    OpenSensor,
    Provenance,
    sensor_stack,
)
from gelpolight_core.session.session import SensorData
from gelpolight_core.simulation.exposure import exposed
from gelpolight_core.simulation.indenters import Indenter, press_surface
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import BareMembrane, PressedMembrane, VirtualSensor
from gelpolight_core.stages.leds.crosstalk import unmix

MISFIT = 0.005
"""Misfit that the noise of the balls leaves in a good calibration."""


@dataclass(frozen=True, slots=True)
class ExactPress:
    """A press with image and true depth.

    Attributes
    ----------
    frame : (height, width, 3) float32
        Linear light without noise.
    truth : TrueDepth
        What was pressed.
    """

    frame: Float32Array
    truth: TrueDepth


@dataclass(frozen=True, slots=True)
class ExactSensor:
    """A virtual sensor with its exact calibration."""

    sensor: VirtualSensor
    calibration: Calibration

    def pressed(
        self, indenter: Indenter, *, x_mm: float = 0.0, y_mm: float = 0.0, samples: int = 3
    ) -> ExactPress:
        """Return the image of an object pressed into the sensor, and the true depth."""
        rest = self.sensor.design.membrane
        decay_mm = rest.decay_length_mm
        surface = press_surface(indenter, x_mm=x_mm, y_mm=y_mm, decay_mm=decay_mm, rest=rest)
        return self.showing(surface, samples)

    def showing(self, surface: PressedSurface, samples: int = 3) -> ExactPress:
        """Return the image of a membrane of any shape, and the true depth."""
        frame = self.sensor.brightness(PressedMembrane(surface), samples=samples)
        truth = TrueDepth(surface.depth_mm, surface.x_mm, surface.y_mm)
        return ExactPress(frame.astype(np.float32), truth)

    def noisy(self, frame: Float32Array, *, seed: int = 0) -> NDArray[np.unsignedinteger[Any]]:
        """Return a linear image as captured by the camera: with noise, as integers."""
        camera = self.sensor.design.camera
        return exposed(frame.astype(np.float64), camera, np.random.default_rng(seed), averaged=1)

    def bare(self) -> Float32Array:
        """Return the image of the untouched membrane."""
        return self.sensor.brightness(BareMembrane()).astype(np.float32)


def with_lambertian_membrane(design: SensorDesign) -> SensorDesign:
    """Return a design with a uniform Lambertian membrane and no crosstalk.

    Its shading is exactly that of the model, so that all errors are numerical.
    """
    membrane = replace(design.membrane, specular_weight=0.0, variation=0.0, speck_count=0)
    photometry = replace(design.photometry, crosstalk=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))
    return replace(design, membrane=membrane, photometry=photometry)


def matt_design(scale: float = 0.25) -> SensorDesign:
    """Return the default sensor made :func:`with_lambertian_membrane`."""
    return with_lambertian_membrane(SensorDesign()).scaled(scale)


def known_sensor(design: SensorDesign, *, seed: int = 0) -> ExactSensor:
    """Return the virtual sensor of a design with its exact calibration.

    Raises
    ------
    InputError
        If the design is not consistent, or cannot be calibrated.
    """
    sensor = VirtualSensor(design, seed)
    return ExactSensor(sensor, exact_calibration(sensor))


def exact_calibration(sensor: VirtualSensor, *, leds_mm: Float64Array | None = None) -> Calibration:
    """Return the exact calibration of a sensor.

    The reflectance table is that of an ideal diffuse membrane; on a glossy one the full model alone
    is exact.

    Parameters
    ----------
    sensor : VirtualSensor
        To be calibrated.
    leds_mm : (3, 3), optional
        LED positions instead of the exact ones.
    """
    design = sensor.design
    layers, c = design.layers, design.camera
    diameter_mm = design.membrane.working_diameter_mm
    x, y, z = layers.normal_camera.tolist()
    plane = TopPlane((x, y, z), layers.top_distance_mm)
    camera = CameraModel(c.width_px, c.height_px, c.fx, c.fy, c.cx, c.cy, (*c.distortion, 0.0))
    description = SensorData(
        design.serial,
        design.ring.nominal_height_mm,
        layers.elastomer_thickness_mm,
        layers.elastomer_refractive_index,
        layers.window_thickness_mm,
        layers.window_refractive_index,
        diameter_mm,
    )
    leds = np.array([[led.x_mm, led.y_mm, -led.height_mm] for led in design.leds])
    leds = leds if leds_mm is None else leds_mm
    mixing = np.array(design.photometry.crosstalk)
    stack = sensor_stack(description, plane)
    surface = exact_shape(design)
    table = build_resampling_table(
        camera, plane, stack, working_diameter_mm=diameter_mm, surface=surface
    )
    raw = table.apply(sensor.brightness(BareMembrane()).astype(np.float32))
    raw[~table.valid] = 0.0
    background = np.maximum(unmix(raw, mixing), 0.0).astype(np.float32)
    shot, read = c.shot_variance, c.read_sd
    median = np.median(background[table.valid], axis=0) if table.valid.any() else np.zeros(3)
    # Of an exact calibration: far below the noise of any camera.
    data = OpenSensor(
        sensor=description,
        camera=camera,
        plane=plane,
        led_positions_mm=leds,
        led_covariance_mm2=np.tile(1e-4 * np.eye(3), (3, 1, 1)),
        crosstalk=mixing,
        radiance=(raw / flat_cosines(table, leds)).astype(np.float32),
        factors=np.where(raw > 0.0, 1.0, 0.0).astype(np.float32),
        reflectance=cosine_table(),
        noise=np.sqrt(shot * median + read**2).astype(np.float64),
        full=FullModel(
            led_positions_mm=leds,
            led_sd_mm=np.full((3, 3), 0.01),
            membrane=exact_membrane(design),
            background=background,
            decay_mm=design.membrane.decay_length_mm,
            misfit=MISFIT,
            kept="mirror",
        ),
        shape=None if surface.flat else surface,
    )
    return Calibration("full", data, {}, Provenance("", "", __version__, design.serial, {}))


def exact_shape(design: SensorDesign) -> MembraneShape:
    """Return the undeformed membrane of a design."""
    membrane = design.membrane
    if membrane.apex_height_mm == 0.0:
        return FLAT
    cap = membrane.apex_height_mm, membrane.working_diameter_mm, membrane.axis_mm
    return MembraneShape("spherical_cap", *cap)


def exact_terms(design: SensorDesign) -> dict[str, float]:
    """Return the values of the terms of the light that a design has."""
    tilts = np.array([led.axis_tilt for led in design.leds])
    values: dict[LightTerm, tuple[float, ...]] = {
        LOBE: (design.ring.lobe_exponent, *tilts.T.ravel().tolist()),
        ABSORPTION: design.layers.elastomer_absorption_per_mm,
        STRETCH: (design.membrane.stretch_loss,),
    }
    return {
        parameter.full_key: value
        for term, given in values.items()
        if given != tuple(parameter.neutral for parameter in term.parameters)
        for parameter, value in zip(term.parameters, given, strict=True)
    }


def exact_membrane(design: SensorDesign) -> MembraneBrdf:
    """Return the membrane of a design in the form of the full model."""
    membrane = design.membrane
    diffuse = (1.0 - membrane.specular_weight) * membrane.diffuse_reflectance
    glossy = membrane.specular_weight * membrane.specular_reflectance
    share = glossy / max(diffuse + glossy, 1e-12)
    return MembraneBrdf(gloss=share, roughness=membrane.roughness, terms=exact_terms(design))
