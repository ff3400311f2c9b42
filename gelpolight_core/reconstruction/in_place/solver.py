"""From an image of a closed sensor to its depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.checks import Note, Notes, free_boundary_note
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.in_place.depth import depth_of, normals
from gelpolight_core.reconstruction.in_place.model import InPlaceModel
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.linear import as_linear
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.reconstruction.trace import Trace, TraceRecorder
from gelpolight_core.translation import tr

Map = NDArray[np.float32]

EXTRAPOLATED_WEIGHT = 0.3
DIFFERENT = 0.12
"""Median change of colour above which an image does not show this sensor's membrane."""
EXAMPLES = 6
THINNED = 4
NOISE_REACH = 8.0
"""Nodes over which the size of the noise is averaged, because there are few examples."""
STEPS = (tr("change of colour"), tr("slopes"), tr("integration"))


@dataclass(frozen=True, slots=True)
class InPlaceDepth:
    """Result from an image of a closed sensor.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Indentation.
    normals : (rows, columns, 3) float32 or None
        Unit normals.
    flags : (rows, columns) uint8
        Sums of :class:`Flag`.
    notes : tuple of Note
        For the user.
    trace : Trace
        What was done.
    gain : (3,)
        Light of each channel over that at calibration, which is corrected.
    slope_sd, depth_sd_mm : (rows, columns) float32 or None
        From the image's noise.
    slope_model_sd, depth_model_sd_mm : (rows, columns) float32 or None
        From the errors of presses that were left out.
    noise_mm : (examples, rows / 4, columns / 4) float32 or None
        Examples of depth errors that the image's noise can cause.
    """

    depth_mm: Map
    normals: Map | None
    flags: NDArray[np.uint8]
    notes: Notes
    trace: Trace
    gain: NDArray[np.float64]
    slope_sd: Map | None = None
    depth_sd_mm: Map | None = None
    slope_model_sd: Map | None = None
    depth_model_sd_mm: Map | None = None
    noise_mm: Map | None = None


class InPlaceSolver:
    """Reconstructs a closed sensor's images.

    Parameters
    ----------
    model : InPlaceModel
        The sensor's.
    noise : (3,)
        Standard deviation of a pixel, per channel.
    workers : int, optional
        Threads; results do not depend on their number.
    """

    def __init__(
        self, model: InPlaceModel, *, noise: NDArray[np.float64], workers: int = 2
    ) -> None:
        self._model = model
        self._noise = noise.astype(np.float32)
        self._threads = RowWorkers(workers)

    def depth(
        self,
        frame: NDArray[Any],
        *,
        effort: str,
        with_normals: bool,
        uncertainty: bool,
    ) -> InPlaceDepth:
        """Reconstruct an image (height, width, 3) of linear light or a linear camera.

        Parameters
        ----------
        frame : (height, width, 3)
            RGB.
        effort : str
            Kept in the trace; there is one mode.
        with_normals, uncertainty : bool
            Results in addition to the depth.
        """
        model, record = self._model, TraceRecorder()
        why = tr("calibration in place has one mode")
        with record.done(STEPS[0], frame.nbytes) as reason:
            linear = as_linear(frame)
            seen = model.change(linear)
            reason.append(why)
        with record.done(STEPS[1], seen.change.nbytes) as reason:
            slope_x, slope_y = model.slopes(seen.change, self._threads)
            beyond = model.extrapolated(seen.change, slope_x, slope_y)
            weight = np.where(beyond, np.float32(EXTRAPOLATED_WEIGHT), np.float32(1.0))
            weight[~seen.usable] = 0.0
            reason.append(why)
        with record.done(STEPS[2], 3 * slope_x.nbytes) as reason:
            depth, crossed = depth_of(
                slope_x,
                slope_y,
                pitch_mm=model.grid.pitch_mm,
                weight=weight,
                workers=self._threads,
            )
            reason.append(why)
        flags = np.zeros(slope_x.shape, np.uint8)
        flags[beyond] |= np.uint8(Flag.EXTRAPOLATED.value)
        flags[seen.saturated] |= np.uint8(Flag.SATURATED.value)
        flags[~seen.usable & ~seen.saturated] |= np.uint8(Flag.INVALID.value)
        crossed_notes = (free_boundary_note(),) if crossed else ()
        if not with_normals:
            record.left_out(tr("normals"), tr("not requested"))
        if not uncertainty:
            record.left_out(tr("standard deviations"), tr("not requested"))
        return InPlaceDepth(
            depth,
            normals(depth, model.grid.pitch_mm) if with_normals else None,
            flags,
            (*crossed_notes, *_difference_notes(seen.change)),
            Trace(effort, tuple(record.steps)),
            seen.gain,
            **(self._deviations(linear, depth, slope_x, slope_y) if uncertainty else {}),
        )

    def _deviations(self, frame: Map, depth_mm: Map, slope_x: Map, slope_y: Map) -> dict[str, Map]:
        """Return the maps of standard deviations, and examples of the depth's noise."""
        errors = self._model.errors
        size = np.hypot(slope_x, slope_y)
        model_sd = np.interp(size, errors.slopes, errors.slope_sd).astype(np.float32)
        depth_model = np.hypot(errors.depth_floor_mm, errors.depth_share * depth_mm)
        random = np.random.default_rng(0)
        slopes, depths = [], []
        for _ in range(EXAMPLES):
            noise = random.standard_normal(frame.shape, np.float32) * self._noise
            seen = self._model.change(frame + noise)
            x, y = self._model.slopes(seen.change, self._threads)
            x, y = x - slope_x, y - slope_y
            pitch = self._model.grid.pitch_mm
            even = np.ones_like(x)
            error = integrate_weighted(x, y, even, pitch_mm=pitch, workers=self._threads)
            slopes.append(0.5 * (x * x + y * y))
            depths.append(error.depth_mm)
        examples = np.stack(depths)
        spread = cv2.GaussianBlur(np.mean(examples**2, axis=0), (0, 0), NOISE_REACH)
        slope_noise = cv2.GaussianBlur(np.mean(slopes, axis=0), (0, 0), NOISE_REACH)
        rows, columns = (n // THINNED for n in size.shape)
        thin = examples[:, : rows * THINNED, : columns * THINNED]
        blocks = thin.reshape(EXAMPLES, rows, THINNED, columns, THINNED)
        return {
            "slope_sd": np.sqrt(slope_noise),
            "depth_sd_mm": np.sqrt(spread),
            "slope_model_sd": model_sd,
            "depth_model_sd_mm": np.asarray(depth_model, np.float32),
            "noise_mm": np.asarray(blocks.mean(axis=(2, 4)), np.float32),
        }


def _difference_notes(change: Map) -> Notes:
    thin = change[::4, ::4]
    if float(np.median(np.abs(thin).max(axis=2))) <= DIFFERENT:
        return ()
    text = tr(
        "most of the image does not look like this sensor's membrane: another "
        "exposure, crop, gel or sensor; the depth is not reliable"
    )
    return (Note(text),)
