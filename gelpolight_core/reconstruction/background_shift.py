"""Background shift of an untouched sensor since its calibration, and setting it to zero."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.health.fault_limits import DARK, SHIFT_PX
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.sensor.sensor_calibration import Calibration, ManualEdit

from .linearise import as_linear, linearise_frame

TOUCHED_SHARE = 0.08
"""A contact changes the light of its walls by tens of percent; a shift of the background is uniform
over the field."""
DIFFERS = 0.03
"""Relative change of the light that counts as different; it tilts a normal by about a degree."""


@dataclass(frozen=True, slots=True)
class BackgroundShift:
    """Difference between an untouched image and the calibration's background.

    Attributes
    ----------
    shift_px : (float, float) or None
        How far the membrane has moved in the camera's image, (u, v); None if it is not known by its
        light and texture.
    brightness_percent : (float, float, float)
        Change of red, green and blue, median over the field.
    differs_percent : float
        Share of the field where a channel differs by more than 3 %.
    touched : bool
        Whether something is pressed, so that the shift is not known.
    quality : QualityTable
        The same as judged figures with advice; the verdict is fail if touched.
    """

    shift_px: tuple[float, float] | None
    brightness_percent: tuple[float, float, float]
    differs_percent: float
    touched: bool
    quality: QualityTable


def background_shift(frame: NDArray[Any], calibration: Calibration) -> BackgroundShift:
    """Compare an image of the untouched sensor with the calibration's background.

    Parameters
    ----------
    frame : (height, width, 3) uint8, uint16 or float32
        RGB; whole numbers as the camera encodes them, floats linear light 0..1.
    calibration : Calibration
        Calibration of the sensor.

    Raises
    ------
    InputError
        If the frame is not of the calibration's size, or not lit.
    """
    _require_size(frame, calibration)
    check = HealthCheck(calibration.data)
    change = check.light(frame)
    median = np.median(change, axis=0)
    if not median.size or float(np.median(median)) < DARK - 1.0:
        raise InputError(
            "the image is dark where the sensor's membrane is",
            "background",
            "Switch all three LEDs on",
        )
    surrounding_change = change[check.samples.beside].mean(axis=1)
    touched = bool((np.abs(change - surrounding_change) > TOUCHED_SHARE).any())
    differs_percent = 100.0 * float((np.abs(change) > DIFFERS).any(axis=1).mean())
    shift = None if touched else check.movement(frame, SHIFT_PX)
    red, green, blue = (100.0 * float(value) for value in median)
    quality = _judge(shift, (red, green, blue), differs_percent, touched)
    return BackgroundShift(shift, (red, green, blue), differs_percent, touched, quality)


def with_zero(
    calibration: Calibration, frames: Sequence[NDArray[Any]], *, operator: str, made: str
) -> Calibration:
    """Return the calibration with its background replaced by the present one (tare).

    The full model compares a press with the background, which is replaced. The paper's model uses
    it in the reflectance factors (Eq. 9), which are computed again with the same table and
    radiance. Lights, lens and membrane are not changed. If they have changed, zero hides this on
    the bare membrane only.

    Parameters
    ----------
    calibration : Calibration
        The calibration. It is not changed; the result is a new one.
    frames : sequence of (height, width, 3)
        Images of the untouched sensor, to be averaged; as for :func:`background_shift`.
    operator : str
        The operator.
    made : str
        Date: ISO 8601 time with zone.

    Raises
    ------
    InputError
        If there is no frame, one is not of the calibration's size, is not lit or saturated, the
        sensor is touched, or camera and membrane have moved against each other.
    """
    if not frames:
        raise InputError(
            "there is no image of the untouched sensor",
            "zero",
            "Capture one, with nothing on the sensor",
        )
    for frame in frames:
        _refuse_unfit(background_shift(frame, calibration))
    total = sum(as_linear(linearise_frame(frame, calibration.response)) for frame in frames)
    present = calibration.data.on_grid(np.asarray(total / len(frames), np.float32))
    edit = ManualEdit("background", CHANNEL_KEYS, made, operator)
    provenance = replace(calibration.provenance, edits=(*calibration.provenance.edits, edit))
    data = calibration.data.with_background(present)
    return replace(calibration, data=data, provenance=provenance)


def _require_size(frame: NDArray[Any], calibration: Calibration) -> None:
    camera = calibration.camera
    if frame.shape != (camera.height, camera.width, 3):
        raise InputError(
            "the image is {shape}, the calibration is for {w}x{h}x3".format(
                shape="x".join(str(n) for n in frame.shape), w=camera.width, h=camera.height
            ),
            "background",
            "Use the calibration of this sensor at this image size",
        )


def _judge(
    shift_px: tuple[float, float] | None,
    brightness: tuple[float, float, float],
    differs_percent: float,
    touched: bool,
) -> QualityTable:
    figures = [
        judge(
            "drift_touched",
            "Contacts on the sensor (0: untouched)",
            float(touched),
            fail=0.5,
            remedy="Remove everything from the sensor and check again",
        )
    ]
    if shift_px is not None:
        figures.append(
            judge(
                "drift_shift_px",
                "Membrane moved in the image",
                math.hypot(*shift_px),
                "px",
                warn=SHIFT_PX,
                fail=2.0,
                remedy=(
                    "Camera and elastomer have moved against each other: seat them, or "
                    "calibrate again"
                ),
            )
        )
    figures += [
        judge(
            f"drift_brightness_{CHANNEL_KEYS[k]}_percent",
            f"Change of brightness, {CHANNEL_KEYS[k]}",
            abs(change),
            "%",
            warn=2.0,
            fail=15.0,
            remedy="Let the LEDs warm up and check exposure and gain, then set to zero",
        )
        for k, change in enumerate(brightness)
    ]
    figures.append(
        judge(
            "drift_differs_percent",
            "Share of the field that differs by 3 %",
            differs_percent,
            "%",
            warn=5.0,
            fail=80.0,
            remedy="Set to zero; if the difference remains, clean the sensor or calibrate again",
        )
    )
    return QualityTable(tuple(figures))


def _refuse_unfit(shift: BackgroundShift) -> None:
    """Refuse an image that is not a background, or that setting to zero cannot correct."""
    for key in ("drift_touched", "drift_shift_px"):
        figures = [f for f in shift.quality.figures if f.key == key]
        if figures and figures[0].verdict is Verdict.FAIL:
            message = (
                "something is pressed into the membrane"
                if shift.touched
                else f"the membrane has moved by {figures[0].value:.1f} px"
            )
            raise InputError(message, "zero", figures[0].remedy)
