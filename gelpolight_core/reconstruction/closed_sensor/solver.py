"""From an image of a closed sensor to its depth."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.health.contact_residual import fits_no_surface, largest_of
from gelpolight_core.health.fault_limits import SIGMAS
from gelpolight_core.health.faults import KEYS, health_of
from gelpolight_core.health.frame_health import FrameHealth, LightGain
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.health.press_scatter import closed_press_scatter
from gelpolight_core.reconstruction.frame_checks import free_boundary_note
from gelpolight_core.reconstruction.height_map import (
    COARSE,
    Flag,
    HeightMap,
    normals_from_slopes,
    surface_slopes,
)
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.linearise import as_linear, linearise_frame
from gelpolight_core.reconstruction.solver import (
    INTEGRATION,
    DepthNoise,
    DepthSolution,
    SolveRequest,
    stride_slices,
)
from gelpolight_core.reconstruction.trace import Trace, TraceStep
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL, ClosedSensor
from gelpolight_core.sensor.closed_sensor.colour_change import LARGEST_CHANGE
from gelpolight_core.sensor.closed_sensor.slope_model import InPlaceModel

from .closed_depth import integrate_free_border

PARTS = 4
"""Newton steps from the flat membrane to the slopes: with 8, images of balls differ by 1e-4."""
NEXT = np.float32(0.01)
"""Change of colour over which the derivative is taken."""


class PredictedColours(NamedTuple):
    """The colours of a surface.

    Attributes
    ----------
    change : (rows, columns, 3) float32
        Change of colour.
    by_colour : (3, 2, rows, columns) float32
        Derivative there of both slopes by each channel.
    slope_variance : float
        Variance of slope errors, which limits how large a change is worth a better fit.
    """

    change: Float32Array
    by_colour: Float32Array
    slope_variance: float

    def least(self, slopes: Float32Array) -> Float32Array:
        """Return the least change (rows, columns, 3) that gives further slopes (2, ...)."""
        by_x, by_y = self.by_colour[:, 0], self.by_colour[:, 1]
        xx, yy = ((by**2).sum(axis=0) + self.slope_variance for by in (by_x, by_y))
        xy = (by_x * by_y).sum(axis=0)
        along_x = (yy * slopes[0] - xy * slopes[1]) / (xx * yy - xy * xy)
        along_y = (xx * slopes[1] - xy * slopes[0]) / (xx * yy - xy * xy)
        return np.moveaxis(by_x * along_x + by_y * along_y, 0, -1)

    def in_known_directions(self, change: Float32Array) -> Float32Array:
        """Return the part of a change (rows, columns, 3) that changes the slopes."""
        return self.least(np.einsum("ksij,ijk->sij", self.by_colour, change))


def predict_colours(
    model: InPlaceModel, slope_x: Float32Array, slope_y: Float32Array
) -> PredictedColours:
    """Return the colours of a surface with slopes (rows, columns)."""
    slopes = np.stack([slope_x, slope_y])
    change = np.zeros((*slope_x.shape, 3), np.float32)
    variance = float(model.errors.slope_sd.min()) ** 2
    for part in range(1, PARTS + 1):
        now, by_colour = _derivative(model, change)
        step = PredictedColours(change, by_colour, variance).least(slopes * (part / PARTS) - now)
        change = np.clip(change + step, -1.0, LARGEST_CHANGE).astype(np.float32)
    return PredictedColours(change, _derivative(model, change)[1], variance)


def _derivative(model: InPlaceModel, change: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return the slopes (2, rows, columns) of a change of colour, and their derivative."""
    now = np.stack(model.slopes(change))
    moved = (np.stack(model.slopes(change + NEXT * axis)) for axis in np.eye(3, dtype=np.float32))
    return now, np.stack([(slopes - now) / NEXT for slopes in moved])


EXAMPLES = 6
NOISE_REACH = 8.0
"""Nodes over which the size of the noise is averaged, because there are few examples."""
BLOCK_NODES = 11
"""Side of the blocks in which the slopes must be those of a surface. Chosen: about the width of the
drape, over which errors of the polynomial are alike."""
KNOWN_SHARE = 0.5
"""Share of a block's nodes that must be usable. Chosen: markers cover less."""
ONE_MODE = "calibration in place has one mode"
SCATTERING = (
    *("led_weak", "exposure", "uneven", "rows", "colour_mixing", "tone", "room_light", "blurred"),
    "camera_moved",
)
"""Faults that are known by how the light of the calibration's own presses scatters."""
UNKNOWN = ("saturated", "dirt", "not_recovered")
"""Faults that presses of closed sensors look like; what is saturated is flagged in the map."""
STEPS = ("change of colour", "slopes", INTEGRATION)


class ClosedHealthCheck(HealthCheck):
    """Checks frames of a closed sensor for the faults that no press can cause."""

    def __init__(self, calibration: ClosedSensor) -> None:
        press_light = calibration.in_place.press_light
        super().__init__(calibration, closed_press_scatter(press_light))
        self._unknown = UNKNOWN if press_light is not None else (*UNKNOWN, *SCATTERING)

    def check(self, frame: NDArray[Any], *, whole: bool = False) -> FrameHealth:
        """Return the faults of a frame, and the change of its light.

        A change of the light that cannot be corrected makes the depth doubtful, not meaningless.
        """
        health = super().check(frame, whole=whole)
        unknown = {*self._unknown, *health.unknown}
        findings = [
            replace(f, verdict=Verdict.WARN, heights=HeightReliability.DOUBTFUL)
            if f.meaningless and f.key in (*SCATTERING[:-1], "other_sensor")
            else f
            for f in health.findings
            if f.key not in UNKNOWN
        ]
        ordered = health_of(findings, unknown=tuple(key for key in KEYS if key in unknown))
        return replace(ordered, untouched=health.untouched, light=health.light, bad=health.bad)


class InPlaceSolver:
    """Reconstructs a closed sensor's images.

    Parameters
    ----------
    calibration : ClosedSensor
        Calibrated data of the sensor.
    workers : int, optional
        Threads; results do not depend on their number.
    """

    made_for: ClassVar[tuple[str, ...]] = (MODEL,)
    visible_mm = None

    def __init__(self, calibration: ClosedSensor, *, workers: int = 2) -> None:
        self.calibration = calibration
        self._model = calibration.in_place
        self._threads = RowThreadPool(workers)

    @staticmethod
    def refuse_unfit(calibration: ClosedSensor) -> None:
        """Refuse nothing: a closed sensor's calibration has one model."""

    @cached_property
    def health_check(self) -> HealthCheck:
        """Check of the faults of a frame, and of the change of its light."""
        return ClosedHealthCheck(self.calibration)

    def needs(self, frame: NDArray[Any], request: SolveRequest) -> Trace:
        """Return which steps a frame needs."""
        return Trace(request.effort, tuple(TraceStep(step, True, ONE_MODE) for step in STEPS))

    def depth(self, frame: NDArray[Any], request: SolveRequest) -> DepthSolution:
        """Reconstruct a frame."""
        model, record = self._model, request.record()
        linear_frame = linearise_frame(frame, self.calibration.response)
        with record.add_done(STEPS[0], linear_frame.nbytes) as reason:
            linear = as_linear(linear_frame)
            colours = model.change(linear, request.gain)
            reason.append(ONE_MODE)
        with record.add_done(STEPS[1], colours.change.nbytes) as reason:
            slope_x, slope_y = model.slopes(colours.change, self._threads)
            extrapolated_mask = model.extrapolated(colours.change, slope_x, slope_y)
            weight = np.where(extrapolated_mask, np.float32(0.3), np.float32(1.0))
            weight[~colours.usable] = 0.0
            reason.append(ONE_MODE)
        with record.add_done(STEPS[2], 3 * slope_x.nbytes) as reason:
            depth, crossed = integrate_free_border(
                slope_x,
                slope_y,
                pitch_mm=model.grid.pitch_mm,
                weight=weight,
                workers=self._threads,
            )
            reason.append(ONE_MODE)
        flags = np.zeros(slope_x.shape, np.uint8)
        flags[extrapolated_mask] |= np.uint8(Flag.EXTRAPOLATED.value)
        flags[colours.saturated] |= np.uint8(Flag.SATURATED.value)
        flags[~colours.usable & ~colours.saturated] |= np.uint8(Flag.INVALID.value)
        if not request.normals:
            record.add_skipped("normals", "not requested")
        if not request.uncertainty:
            record.add_skipped("standard deviations", "not requested")
        fitted, lengths = surface_slopes(depth, model.grid.pitch_mm), self.calibration.length_errors
        normals = self._normals(*fitted) if request.normals else None
        return DepthSolution(
            depth,
            normals,
            flags,
            (
                *((free_boundary_note(),) if crossed else ()),
                *self._misfit((slope_x, slope_y), fitted, colours.usable),
            ),
            Trace(request.effort, tuple(record.steps)),
            self._deviations(linear, request, depth, slope_x, slope_y)
            if request.uncertainty
            else None,
            depth_scale_sd=lengths.depth,
            lateral_scale_sd=lengths.lateral,
            image_blur_mm=lengths.blur_mm,
        )

    def _misfit(
        self,
        found: tuple[Float32Array, Float32Array],
        fitted: tuple[Float32Array, Float32Array],
        usable_mask: BoolArray,
    ) -> tuple[Finding, ...]:
        """Return a finding if the slopes found differ too much from those of the fitted surface.

        The mean difference in a block is compared with the largest that is expected of as many
        blocks by the errors of presses that were left out. Walls steeper than those of the balls
        are not judged.
        """
        errors, size = self._model.errors, (BLOCK_NODES, BLOCK_NODES)
        # The mean of a block is that of its nodes without markers.
        usable = usable_mask.astype(np.float32)
        known = cv2.blur(usable, size)
        off_x, off_y, slope = (
            cv2.blur(usable * part, size) / np.maximum(known, KNOWN_SHARE)
            for part in (found[0] - fitted[0], found[1] - fitted[1], cv2.magnitude(*fitted))
        )
        gentle = (cv2.magnitude(*found) <= self._model.steepest) | ~usable_mask
        judged_mask = cv2.erode(gentle.astype(np.uint8), np.ones(size, np.uint8)) > 0
        judged_mask &= known >= KNOWN_SHARE
        blocks = np.count_nonzero(judged_mask) / BLOCK_NODES**2
        if blocks < 2.0:
            return ()
        sd = np.interp(slope, errors.slopes, errors.slope_sd)
        share = np.where(judged_mask, cv2.magnitude(off_x, off_y) / sd, 0.0)
        row, column = np.unravel_index(share.argmax(), share.shape)
        times = float(share[row, column]) / largest_of(blocks)
        if times <= SIGMAS:
            return ()
        grid = self.calibration.table.grid
        return (fits_no_surface(times, (float(grid.x_mm[column]), float(grid.y_mm[row]))),)

    def _normals(self, slope_x: Float32Array, slope_y: Float32Array) -> Float32Array:
        """Return the normals of the membrane with these slopes of its depth."""
        surface = self._model.grid.surface
        if not surface.flat:
            at_rest = surface.slopes(self.calibration.table.grid.points_mm())
            slope_x, slope_y = (
                np.asarray(slope - at_rest[..., k], np.float32)
                for k, slope in enumerate((slope_x, slope_y))
            )
        return normals_from_slopes(slope_x, slope_y)

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Float32Array:
        """Return 1 plus the change of colour of a surface."""
        lit_mask = self._model.reference.known[..., None]
        image = np.where(lit_mask, 1.0 + self._inverse(height_map).change, np.nan)
        return np.asarray(image[stride_slices(step)], np.float32)

    def residual(
        self, frame: NDArray[Any], height_map: HeightMap, *, step: int = 1
    ) -> Float32Array:
        """Return the change of colour minus the predicted one, in the known directions."""
        linear = as_linear(linearise_frame(frame, self.calibration.response))
        colours = self._model.change(linear, SolveRequest(health=height_map.health).gain)
        predicted = self._inverse(height_map)
        residual = predicted.in_known_directions(colours.change - predicted.change)
        residual = np.where(colours.usable[..., None], residual, np.nan)
        return np.asarray(residual[stride_slices(step)], np.float32)

    def _inverse(self, height_map: HeightMap) -> PredictedColours:
        return predict_colours(
            self._model, *surface_slopes(height_map.depth_mm, height_map.pitch_mm)
        )

    def _deviations(
        self,
        frame: Float32Array,
        request: SolveRequest,
        depth_mm: Float32Array,
        slope_x: Float32Array,
        slope_y: Float32Array,
    ) -> DepthNoise:
        """Return the maps of standard deviations, and examples of the depth's noise."""
        errors = self._model.errors
        size = np.hypot(slope_x, slope_y)
        model_sd = np.interp(size, errors.slopes, errors.slope_sd).astype(np.float32)
        depth_model = np.hypot(errors.depth_floor_mm, errors.depth_share * depth_mm)
        noise_sd = self.calibration.noise.astype(np.float32)
        light = request.light or LightGain(np.ones(3), np.zeros(3))
        random = np.random.default_rng(0)
        slopes, depths = [], []
        for _ in range(EXAMPLES):
            noise = random.standard_normal(frame.shape, np.float32) * noise_sd
            gain = light.share + light.sd * random.standard_normal(3)
            colours = self._model.change(frame + noise, gain)
            x, y = self._model.slopes(colours.change, self._threads)
            x, y = x - slope_x, y - slope_y
            pitch = self._model.grid.pitch_mm
            even = np.ones_like(x)
            error = integrate_weighted(x, y, even, pitch_mm=pitch, workers=self._threads)
            slopes.append(0.5 * (x * x + y * y))
            depths.append(error.depth_mm)
        examples = np.stack(depths)
        spread = cv2.GaussianBlur(np.mean(examples**2, axis=0), (0, 0), NOISE_REACH)
        slope_noise = cv2.GaussianBlur(np.mean(slopes, axis=0), (0, 0), NOISE_REACH)
        rows, columns = (n // COARSE for n in size.shape)
        thin = examples[:, : rows * COARSE, : columns * COARSE]
        blocks = thin.reshape(EXAMPLES, rows, COARSE, columns, COARSE)
        return DepthNoise(
            np.sqrt(slope_noise),
            np.sqrt(spread),
            model_sd,
            np.asarray(depth_model, np.float32),
            np.asarray(blocks.mean(axis=(2, 4)), np.float32),
        )
