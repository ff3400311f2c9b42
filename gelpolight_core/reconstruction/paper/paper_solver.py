"""From one image to depth by the paper's model: slopes (Eq. 10), their divergence, integration.

Resampling, division by light and factor, the reflectance table and the 3x3 solve are done block by
block of nodes, so that each byte of the image is read once. Lights are those of the flat membrane.
"""

from __future__ import annotations

from functools import cached_property
from threading import Lock
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.compiling import part, whole
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.membrane_masks import SATURATED, usable_mask
from gelpolight_core.light.directions import light_directions
from gelpolight_core.reconstruction.buffers import BufferPool
from gelpolight_core.reconstruction.compiled import BLOCK
from gelpolight_core.reconstruction.frame_checks import (
    boundary_nodes,
    contact_crosses,
    fixed_boundary_note,
    paper_notes,
    refuse_unsolvable,
    visible_depth_notes,
)
from gelpolight_core.reconstruction.height_map import (
    Flag,
    HeightMap,
    normals_from_slopes,
    surface_slopes,
)
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.linearise import linearise_frame
from gelpolight_core.reconstruction.solver import (
    INTEGRATION,
    LOOKING,
    NOTHING_PRESSED,
    DepthSolution,
    OpenSolver,
    SolveRequest,
    flat_normals,
    not_visible_reason,
    stride_slices,
)
from gelpolight_core.reconstruction.trace import Trace, TraceRecorder, TraceStep
from gelpolight_core.sensor.sensor_calibration import OpenSensor

from .kernel import STATIC_PLANES, blank_rows, solve_row, work_arrays

_stencil_part = part(fastmath={"nsz", "contract", "reassoc"})


@_stencil_part
def _add_along_row(slope, start, weights, target):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the x part of the divergence of one line of slopes to one line."""
    columns = slope.shape[0]
    inner = max(columns - 4, 0)
    for at in range(columns - inner):
        # The few next to the border, on both sides of the inner ones.
        column = at if at < 2 else at + inner
        for tap in range(min(columns, 5)):
            target[column] += weights[column, tap] * slope[start[column] + tap]
    if inner > 0:
        a, b, c, d, e = weights[2]
        middle = target[2 : 2 + inner]
        for k in range(inner):
            middle[k] += (
                a * slope[k]
                + b * slope[k + 1]
                + c * slope[k + 2]
                + d * slope[k + 3]
                + e * slope[k + 4]
            )


@_stencil_part
def _add_down(ring, begin, weights, target):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the y part of the divergence of one line, from five lines of slopes in a ring."""
    a, b, c, d, e = weights
    r0, r1, r2 = ring[begin % 5], ring[(begin + 1) % 5], ring[(begin + 2) % 5]
    r3, r4 = ring[(begin + 3) % 5], ring[(begin + 4) % 5]
    for k in range(target.shape[0]):
        target[k] += a * r0[k] + b * r1[k] + c * r2[k] + d * r3[k] + e * r4[k]


@whole(fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def paper_divergence_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, image, sensor, edges, keep, slope_x, slope_y, flags, field
):
    """Write lines `first` to `last` of the divergence, and their flags.

    `image` and `sensor` as for `solve_row`; `edges` are :class:`EdgeWeights`. Slopes (rows,
    columns) are written where `keep`. They are finite and within their limit by the way they are
    made.
    """
    start_x, weight_x, start_y, weight_y = edges
    work = work_arrays()
    rows, columns = flags.shape
    ring_x, ring_y = np.zeros((5, columns), np.float32), np.zeros((5, columns), np.float32)
    others = np.zeros(columns, np.uint8)
    loaded = -1
    for line in range(first, last):
        field[line] = 0
        begin = start_y[line]
        if loaded < 0:
            loaded = begin
        while loaded < min(begin + 5, rows):
            slot = loaded % 5
            # What two threads need is made by both and written by one.
            is_own = first <= loaded < last
            marks = flags[loaded] if is_own else others
            solve_row(loaded, image, sensor, work, ring_x[slot], ring_y[slot], marks)
            if keep and is_own:
                for column in range(columns):
                    slope_x[loaded, column] = ring_x[slot, column]
                    slope_y[loaded, column] = ring_y[slot, column]
            loaded += 1
        _add_down(ring_y, begin, weight_y[line], field[line])
        _add_along_row(ring_x[line % 5], start_x, weight_x, field[line])


class SlopeField(NamedTuple):
    """Slopes of the depth, d(depth)/dx and d(depth)/dy, with their divergence.

    Attributes
    ----------
    divergence : (rows, columns) float32
        Divergence, for the integration.
    slope_x, slope_y : (rows, columns) float32
        Slopes, of size 0 where they were not requested.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    """

    divergence: Float32Array
    slope_x: Float32Array
    slope_y: Float32Array
    flags: NDArray[np.uint8]


PAPER_REASON = "the paper's model has one mode"
PAPER_STEPS = ("resampling, normals and their divergence", INTEGRATION)


class PaperSolver(OpenSolver):
    """Reconstructs frames by the paper's model, with constant data prepared once.

    Several threads can call it. They then wait for each other.

    Parameters
    ----------
    calibration : OpenSensor
        Calibrated data of the sensor.
    workers : int
        Number of threads.
    """

    visible_mm = None

    def __init__(self, calibration: OpenSensor, *, workers: int) -> None:
        node_mask = usable_mask(calibration.table.valid, calibration.radiance, calibration.factors)
        super().__init__(calibration, calibration.led_positions_mm, node_mask, workers)
        grid = calibration.table.grid
        self._integration = PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=workers)
        self._static, self._lit = _blocks(calibration, node_mask)
        lookup, self._scale = calibration.reflectance.lookup()
        self._table = _steps(lookup)
        coverage = calibration.reflectance.coverage.astype(np.float32)
        x_mm = grid.x_mm.astype(np.float32)
        self._sensor = (
            tuple((low, high) for low, high in coverage),
            tuple(tuple(led) for led in calibration.led_positions_mm.astype(np.float32)),
            float(x_mm[0]),
            float(x_mm[-1] - x_mm[0]) / max(x_mm.size - 1, 1),
            np.ascontiguousarray(grid.y_mm, np.float32),
        )
        self._boundary = boundary_nodes(calibration)
        self._take = BufferPool().take
        self._lock = Lock()

    @staticmethod
    def refuse_unfit(calibration: OpenSensor) -> None:
        """Refuse a curved membrane, lights nearly in one plane, and a membrane without light."""
        if not calibration.surface.flat:
            raise InputError(
                "The paper's model is for flat membranes",
                calibration.serial,
                Remedy.OTHER_MODEL,
            )
        refuse_unsolvable(calibration, calibration.led_positions_mm, calibration.radiance)

    @cached_property
    def ray_spread_per_mm(self) -> float:
        """Relative divergence of the rays per mm of depth."""
        table = self.calibration.table
        rows, columns = table.grid.shape
        window = np.s_[rows // 4 : 3 * rows // 4, columns // 4 : 3 * columns // 4]
        across = np.gradient(table.ray_slope[window][..., 0], axis=1)[table.valid[window]]
        return float(np.median(np.abs(across))) / table.grid.pitch_mm if across.size else 0.0

    def needs(self, frame: NDArray[Any], request: SolveRequest) -> Trace:
        """Return which steps a frame needs."""
        record = request.record()
        if self._contact(frame, request, record):
            record.steps += [TraceStep(step, True, PAPER_REASON) for step in PAPER_STEPS]
        return Trace(request.effort, tuple(record.steps))

    def _contact(self, frame: NDArray[Any], request: SolveRequest, record: TraceRecorder) -> bool:
        """Return whether something may be pressed, as the full model finds it."""
        linear, health = frame.dtype.kind == "f", request.health
        # It takes time, and is worth it only where the whole field is as at calibration.
        if health is None or health.untouched != 1.0 or self.calibration.full is None:
            return True
        if linear and not np.isfinite(frame).all():
            return True
        with record.add_done(LOOKING, frame.nbytes) as reason:
            finder = self.finder(linear)
            contact = finder.find(
                np.require(frame, requirements=["C", "W"]), self.workers, request.gain
            )
            reason.append(
                not_visible_reason(finder.visible_mm) if contact is None else PAPER_REASON
            )
        if contact is None:
            for step in PAPER_STEPS:
                record.add_skipped(step, NOTHING_PRESSED)
        return contact is not None

    def _flat(
        self, frame: NDArray[Any], request: SolveRequest, record: TraceRecorder
    ) -> DepthSolution:
        """Return the result where nothing is pressed."""
        visible_mm = self.finder(frame.dtype.kind == "f").visible_mm
        return DepthSolution(
            np.zeros(self._usable.shape, np.float32),
            flat_normals(self._usable.shape) if request.normals else None,
            ~self._usable * np.uint8(Flag.OUTSIDE),
            (*self._condition_notes, *visible_depth_notes(visible_mm)),
            Trace(request.effort, tuple(record.steps)),
            visible_depth_mm=visible_mm,
            lateral_per_mm=self.ray_spread_per_mm,
        )

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Float32Array:
        """Return the image of a surface by Eq. 6, with the light of the flat membrane."""
        at, calibration = stride_slices(step), self.calibration
        points = calibration.table.grid.points_mm()[at]
        light, _ = light_directions(
            calibration.led_positions_mm, np.dstack([points, np.zeros(points.shape[:2])])
        )
        slopes = surface_slopes(height_map.depth_mm, height_map.pitch_mm, step=step)
        normals = normals_from_slopes(*(slope[at] for slope in slopes))
        cosines = np.einsum("ijkc,ijc->ijk", light, normals)
        ratio = np.stack(
            [
                calibration.reflectance.response(k, cosines[..., k])
                / calibration.reflectance.response(k, -light[..., k, 2])
                for k in range(3)
            ],
            axis=-1,
        )
        return np.asarray(np.where(self._usable[at][..., None], ratio, np.nan), np.float32)

    def depth(self, frame: NDArray[Any], request: SolveRequest) -> DepthSolution:
        """Reconstruct a frame."""
        image, record = frame, request.record()
        if not self._contact(frame, request, record):
            return self._flat(frame, request, record)
        response = self.calibration.response
        if response is not None and frame.dtype.kind != "f":
            with record.add_done("linear light", frame.nbytes) as reason:
                image = linearise_frame(frame, response)
                reason.append("the camera's response is not linear")
        with record.add_done(PAPER_STEPS[0], frame.nbytes) as reason:
            field = self.slopes(image, keep=request.normals, gain=request.gain)
            reason.append(PAPER_REASON)
        with record.add_done(PAPER_STEPS[1], 2 * field.divergence.nbytes) as reason:
            depth_mm = self._integration.depth_of(field.divergence)
            self.workers.run(len(depth_mm), blank_rows, field.flags, depth_mm)
            reason.append(PAPER_REASON)
        if not request.normals:
            record.add_skipped("normals", "not requested")
        record.add_skipped("standard deviations", "the paper's model states none")
        normals = normals_from_slopes(field.slope_x, field.slope_y) if request.normals else None
        depth_mm = np.asarray(depth_mm, np.float32)
        height_mm = float(-self.calibration.led_positions_mm[:, 2].max())
        notes = (*self._condition_notes, *paper_notes(depth_mm, field.flags, height_mm))
        if contact_crosses(depth_mm, self._boundary):
            notes += (fixed_boundary_note(),)
            field.flags[(field.flags & np.uint8(Flag.OUTSIDE)) == 0] |= np.uint8(Flag.UNANCHORED)
        return DepthSolution(
            depth_mm,
            normals,
            field.flags,
            notes,
            Trace(request.effort, tuple(record.steps)),
            lateral_per_mm=self.ray_spread_per_mm,
        )

    def slopes(
        self, image: NDArray[Any], *, keep: bool = True, gain: Float64Array | None = None
    ) -> SlopeField:
        """Solve Eq. (10): return the divergence of the slopes, and the slopes if requested.

        Parameters
        ----------
        image : (height, width, 3) uint8, uint16 or float32
            Image in RGB order; float images are 0..1.
        keep : bool, optional
            Whether the slopes are returned, too.
        gain : (3,), optional
            Light of each channel over that at calibration.
        """
        shape = self._usable.shape
        slope_x, slope_y = (np.empty(shape if keep else (0, 0), np.float32) for _ in range(2))
        flags = np.empty(shape, np.uint8)
        divergence = np.empty(shape, np.float32)
        with self._lock:
            self.workers.run(
                len(divergence),
                paper_divergence_rows,
                *self._of_image(image, gain),
                self._integration.edges,
                keep,
                slope_x,
                slope_y,
                flags,
                divergence,
            )
        return SlopeField(divergence, slope_x, slope_y, flags)

    def _of_image(
        self, raw: NDArray[Any], gain: Float64Array | None
    ) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return an image and the sensor in the form for the kernels."""
        height, width = raw.shape[:2]
        # numba would compile the kernel a second time for a read-only array.
        raw = np.require(raw, requirements=["C", "W"])
        full_scale = np.float32(1.0 if raw.dtype.kind == "f" else np.iinfo(raw.dtype).max)
        pairs = self._pairs(raw) if raw.dtype == np.uint8 and width > 1 else None
        limit = np.float32(SATURATED) * full_scale
        scale = self._scale if gain is None else (self._scale / gain).astype(np.float32)
        sensor = (self._static, self._lit, self._table, tuple(scale / full_scale), *self._sensor)
        return (raw.reshape(-1, 3), pairs, width, height, limit), sensor

    def _pairs(self, raw: NDArray[np.uint8]) -> NDArray[np.uint64]:
        """Return words (pixels,) with three bytes each of a pixel and of the next one.

        The words overlap, as each neighbour has its own.
        """
        height, width = raw.shape[:2]
        words = self._take("words", (height * width + 1,), np.uint32)
        pixels = words[:-1].view(np.uint8).reshape(height, width, 4)
        cv2.cvtColor(raw, cv2.COLOR_RGB2RGBA, dst=pixels)
        return np.ndarray((height * width,), np.uint64, words, strides=(4,))


def _blocks(
    calibration: OpenSensor, mask: NDArray[np.bool_]
) -> tuple[Float32Array, NDArray[np.bool_]]:
    """Return pixels and gains 1 / (rho |L|) by block, and the mask of blocks with known nodes.

    Unknown nodes have gain 0.
    """
    table = calibration.table
    rows, columns = table.u_px.shape
    count = -(-columns // BLOCK)
    strength = calibration.radiance * calibration.factors
    planes = np.zeros((STATIC_PLANES, rows, count * BLOCK), np.float32)
    imaged_mask = mask & (table.u_px >= 0.0) & (table.v_px >= 0.0)
    for plane, source in enumerate((table.u_px, table.v_px, *np.moveaxis(strength, 2, 0))):
        values = source[imaged_mask]
        planes[plane, :, :columns][imaged_mask] = values if plane < 2 else 1.0 / values
    parted = planes.reshape(STATIC_PLANES, rows, count, BLOCK).transpose(1, 2, 0, 3)
    lit = np.asarray((parted[:, :, 2] > 0.0).any(axis=2), np.bool_)
    static = np.ascontiguousarray(parted, np.float32)
    return static.reshape(rows, count, STATIC_PLANES * BLOCK), lit


def _steps(lookup: Float32Array) -> NDArray[np.uint64]:
    """Return (3 * size,): of each entry its cosine and the step to the next, half a word each."""
    both = np.zeros((*lookup.shape, 2), np.float32)
    both[..., 0] = lookup
    both[:, :-1, 1] = np.diff(lookup, axis=1)
    return both.view(np.uint64).ravel()
