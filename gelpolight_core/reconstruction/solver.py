"""Interface of the solvers of all models, with the part that open sensors share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.finding import Finding
from gelpolight_core.base.membrane_masks import LEAST_LIGHT, SATURATED
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.health.frame_health import FrameHealth, LightGain
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.health.press_scatter import open_press_scatter
from gelpolight_core.reconstruction.near_light.contact_detection import (
    ContactFinder,
    contact_finder,
)
from gelpolight_core.sensor.sensor_calibration import MODELS, OpenSensor

from .frame_checks import condition_notes
from .height_map import HeightMap
from .linearise import as_linear, linearise_frame
from .trace import Trace, TraceRecorder, TraceStep

LIGHT = "light of the image"
LOOKING = "contact detection"
INTEGRATION = "integration"
NOTHING_PRESSED = "nothing is pressed into the membrane"


@dataclass(frozen=True, slots=True)
class SolveRequest:
    """Request of a depth map to a solver.

    Attributes
    ----------
    effort : str
        One of `EFFORTS`; only the full model has more than one.
    normals, uncertainty : bool
        Results in addition to the depth. Standard deviations are those of effort ``best``.
    everywhere : bool
        Whether the whole field is solved, without contact detection.
    health : FrameHealth or None
        Health check of the frame, whose change of the light is undone; None: no change is known.
    """

    effort: str = "best"
    normals: bool = True
    uncertainty: bool = False
    everywhere: bool = False
    health: FrameHealth | None = None

    @property
    def light(self) -> LightGain | None:
        """Change of the light since the calibration, or None where none is known."""
        return None if self.health is None else self.health.light

    @property
    def gain(self) -> Float64Array | None:
        """Light of each channel (3,) over that at calibration, or None where it is the same."""
        return None if self.light is None else self.light.share

    def record(self) -> TraceRecorder:
        """Return the record of a frame, which begins with its light."""
        if self.gain is None:
            reason = "it is as at calibration, or cannot be corrected"
            return TraceRecorder([TraceStep(LIGHT, False, reason)])
        shares = ", ".join(f"{share:.4f}" for share in self.gain)
        reason = f"red, green and blue are {shares} of those at calibration, which is corrected"
        return TraceRecorder([TraceStep(LIGHT, True, reason, 0.0)])


@dataclass(frozen=True, slots=True)
class DepthNoise:
    """Standard deviations of slopes and depth on the metric grid.

    Attributes
    ----------
    slope_sd, depth_sd_mm : (rows, columns) float32
        Standard deviations from the noise of a single image, and from the correction of its light.
    slope_model_sd, depth_model_sd_mm : (rows, columns) float32
        Standard deviations from errors of the model.
    noise_mm : (examples, rows / 4, columns / 4) float32
        Examples of depth errors that this noise can cause. Each is a whole map, so that a standard
        deviation can be computed for every quantity derived from a depth map.
    """

    slope_sd: Float32Array
    depth_sd_mm: Float32Array
    slope_model_sd: Float32Array
    depth_model_sd_mm: Float32Array
    noise_mm: Float32Array


@dataclass(frozen=True, slots=True)
class DepthSolution:
    """The reconstruction of a frame, on the grid of the calibration.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Indentation.
    normals : (rows, columns, 3) float32 or None
        Unit normals, z < 0; None where they were not requested.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    findings : tuple of Finding
        Findings about this map.
    trace : Trace
        Steps that were done or left out.
    noise : DepthNoise or None
        Uncertainty of the depth, if requested.
    depth_scale_sd, lateral_scale_sd, visible_depth_mm, image_blur_mm, lateral_per_mm
        As in :class:`HeightMap`.
    """

    depth_mm: Float32Array
    normals: Float32Array | None
    flags: NDArray[np.uint8]
    findings: tuple[Finding, ...]
    trace: Trace
    noise: DepthNoise | None = None
    depth_scale_sd: float | None = None
    lateral_scale_sd: float | None = None
    visible_depth_mm: float | None = None
    image_blur_mm: float | None = None
    lateral_per_mm: float = 0.0


class Solver(Protocol):
    """Reconstructs the frames of one sensor by one model.

    Frames are (height, width, 3) in RGB: whole numbers as the camera encodes them, floats linear
    light 0..1. Images of a surface are brightness over that of the untouched membrane, for each
    channel of the camera, on the calibration's grid: (rows, columns, 3), 1 where nothing is
    pressed, NaN where it is not known. A node shows what the camera sees there, in the direction
    of the flat membrane's node.

    Attributes
    ----------
    made_for : tuple of str
        Models of the calibrations that it can use.
    """

    made_for: ClassVar[tuple[str, ...]]

    @property
    def visible_mm(self) -> float | None:
        """Smallest depth of a flat face above the noise, or None if it is not known."""

    def __init__(self, calibration: Any, *, workers: int) -> None: ...

    @staticmethod
    def refuse_unfit(calibration: Any) -> None:
        """Refuse a calibration that the model cannot use."""

    @property
    def health_check(self) -> HealthCheck:
        """Check of the faults of a frame, and of the change of its light."""

    def depth(self, frame: NDArray[Any], request: SolveRequest) -> DepthSolution:
        """Reconstruct a frame."""

    def needs(self, frame: NDArray[Any], request: SolveRequest) -> Trace:
        """Return which steps a frame needs, with the reasons."""

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Float32Array:
        """Return the image of a surface, at the nodes of :func:`stride_slices`."""

    def residual(
        self, frame: NDArray[Any], height_map: HeightMap, *, step: int = 1
    ) -> Float32Array:
        """Return a frame's image minus :meth:`predict`, as far as the model knows the image."""


class OpenSolver(ABC):
    """Base of the solvers of open sensors.

    Parameters
    ----------
    calibration : OpenSensor
        Calibrated data of the sensor.
    leds_mm : (3, 3)
        LED positions that the model uses.
    usable_mask : (rows, columns) bool
        Nodes that it can solve.
    workers : int
        Number of threads.
    """

    made_for: ClassVar[tuple[str, ...]] = MODELS

    def __init__(
        self,
        calibration: OpenSensor,
        leds_mm: NDArray[np.float64],
        usable_mask: NDArray[np.bool_],
        workers: int,
    ) -> None:
        self.calibration = calibration
        self.workers = RowThreadPool(workers)
        self._finders: dict[bool, ContactFinder] = {}
        self._usable = usable_mask
        self._leds_mm = leds_mm
        self._condition_notes = condition_notes(calibration, leds_mm)

    @cached_property
    def health_check(self) -> HealthCheck:
        """Check of the faults of a frame, and of the change of its light."""
        full = self.calibration.full
        usual = open_press_scatter(0.0 if full is None else full.membrane.interreflection)
        return HealthCheck(
            self.calibration, usual, crosstalk=self.calibration.crosstalk, leds_mm=self._leds_mm
        )

    @cached_property
    def _background(self) -> Float32Array:
        return self.calibration.background

    def finder(self, linear: bool) -> ContactFinder:
        """Return the contact detection for raw images, or for images in linear light."""
        full = self.calibration.full
        assert full is not None
        is_linear = linear or self.calibration.response is None
        if is_linear not in self._finders:
            encoded = replace(self.calibration, response=None) if is_linear else self.calibration
            self._finders[is_linear] = contact_finder(encoded, full)
        return self._finders[is_linear]

    @abstractmethod
    def predict(self, height_map: HeightMap, *, step: int = 1) -> Float32Array:
        """Return the image of a surface."""

    def residual(
        self, frame: NDArray[Any], height_map: HeightMap, *, step: int = 1
    ) -> Float32Array:
        """Return a frame over the background minus the image of a surface."""
        table, at = self.calibration.table, stride_slices(step)
        gain = SolveRequest(health=height_map.health).gain
        linear = as_linear(linearise_frame(frame, self.calibration.response))
        measured = cv2.remap(linear, table.u_px, table.v_px, cv2.INTER_LINEAR)
        background = self._background * np.asarray(1.0 if gain is None else gain, np.float32)
        valid = self._usable[..., None] & (measured < SATURATED) & (self._background > LEAST_LIGHT)
        ratio = np.where(valid, measured / np.maximum(background, LEAST_LIGHT), np.float32(1.0))
        # A node of the thinned grid represents its neighbours, and so does its brightness.
        averaged = cv2.blur(ratio, (step, step)) if step > 1 else ratio
        residual = averaged[at] - self.predict(height_map, step=step)
        return np.asarray(np.where(valid[at], residual, np.nan), np.float32)


def not_visible_reason(visible_mm: float) -> str:
    """Return why an image without a contact is not solved."""
    text = "the image equals the background; smallest visible depth {um:.0f} \N{MICRO SIGN}m"
    return text.format(um=1e3 * visible_mm)


def stride_slices(step: int) -> tuple[slice, slice]:
    """Return every `step`-th node along both axes, from the middle of the first block."""
    return np.s_[step // 2 :: step, step // 2 :: step]


def flat_normals(shape: tuple[int, ...]) -> Float32Array:
    """Return normals (rows, columns, 3) of the flat membrane."""
    normals = np.zeros((*shape, 3), np.float32)
    normals[..., 2] = -1.0
    return normals
