"""The light of each ball press of an open sensor, corrected to that of the background.

LEDs that warm up, or an exposure that drifts, change the light from image to image. As in a
measurement, the change is fitted to the membrane far from the contact, and is corrected where it is
larger than its noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT, saturated_mask
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.health.faults import LIGHT
from gelpolight_core.health.frame_health import LightGain
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.health.press_scatter import open_press_scatter
from gelpolight_core.image.grain import Grain
from gelpolight_core.image.response import CameraResponse

from .ball_image import PressLight

MOST_REFLECTED = 1.0
"""Reflectance for interreflected light of a membrane of which it is not known yet: it decides how
much a press itself changes the light."""


@dataclass(frozen=True, slots=True)
class StageBackground:
    """Background of a calibration in progress, as the health check reads it.

    Attributes
    ----------
    camera : CameraModel
        The lens.
    table : ResamplingTable
        The grid and its rays.
    background : (rows, columns, 3) float32
        The untouched membrane on the grid, 0 where it is not known.
    noise : (3,)
        At least that of rounding. Deviations of the fit follow from the scatter of its samples.
    response, grain : None
        Images are in linear light, and their fine detail is not judged.
    """

    camera: CameraModel
    table: ResamplingTable
    background: Float32Array
    noise: Float64Array = field(default_factory=lambda: np.zeros(3))
    response: CameraResponse | None = None
    grain: Grain | None = None


def press_light_check(
    background: Float32Array,
    table: ResamplingTable,
    camera: CameraModel,
    crosstalk: Float64Array,
    leds_mm: Float64Array,
) -> HealthCheck:
    """Return the health check of the images of ball presses.

    Parameters
    ----------
    background : (rows, columns, 3) float32
        The untouched membrane as the camera sees it, on the grid.
    table : ResamplingTable
        The grid and its rays.
    camera : CameraModel
        The lens.
    crosstalk : (3, 3)
        Response of the channels to the LEDs.
    leds_mm : (3, 3)
        LED positions in the sensor frame.
    """
    seen = np.where(table.valid[..., None], background, np.float32(0.0))
    reference = StageBackground(camera, table, seen)
    usual = open_press_scatter(MOST_REFLECTED)
    return HealthCheck(reference, usual, crosstalk=crosstalk, leds_mm=leds_mm)


def measure_press_light(rgb: Float32Array, check: HealthCheck) -> PressLight:
    """Measure the light of a ball press (height, width, 3) in linear light, bad pixels filled."""
    health = check.check_repaired(rgb)
    gain, largest = health.light, 0.0
    if gain is not None and gain.is_even:
        # Room light is not corrected. In an image that was rounded twice, a gain looks a little
        # like it: the gain alone leaves the smaller error.
        common, _ = check.change(rgb)
        gain = LightGain(1.0 + common.gain, common.gain_sd)
    if gain is not None:
        before = undo_light_change(rgb, gain)
        lit = before > LEAST_LIGHT
        largest = float(np.abs(rgb[lit] / before[lit] - 1.0).max(initial=0.0))
    uncorrected = tuple(fault.key for fault in health.faults if fault.key in LIGHT)
    found = [finding.key for finding in health.findings if finding.key in LIGHT]
    corrected = tuple(key for key in found if gain is not None and key not in uncorrected)
    return PressLight(gain, largest, corrected, uncorrected)


def undo_light_change(rgb: Float32Array, gain: LightGain | None) -> Float32Array:
    """Return an image (height, width, 3) in the light of the background, saturated pixels kept."""
    if gain is None:
        return rgb
    light = gain.evened(rgb) / gain.share.astype(np.float32)
    return np.where(saturated_mask(rgb), rgb, light)
