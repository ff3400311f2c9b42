"""Normals of the membrane from one image: the paper's model (Eq. 10), in one fused pass.

Resampling, division by light and factor, the reflectance table and the 3x3 solve are done block by
block of nodes, so that each byte of the image is read once. Lights are those of the flat membrane.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.masks import SATURATED
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.paper.divergence import paper_divergence_rows
from gelpolight_core.reconstruction.paper.kernel import BLOCK, STATIC_PLANES
from gelpolight_core.reconstruction.threads import RowWorkers

Map = NDArray[np.float32]
Gain = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ShadingMaps:
    """Data of a calibration for the pass, as float32 arrays.

    Attributes
    ----------
    u_px, v_px : (rows, columns)
        Raw pixel of each node; negative where it is not seen.
    gain : (rows, columns, 3)
        1 / (rho |L|); 0 where the node is not usable.
    lookup : (3, size)
        R sampled evenly (Eq. 7).
    lookup_scale : (3,)
        Processed value to place in `lookup`.
    coverage : (3, 2)
        Cosines that the table has data for.
    leds_mm : (3, 3)
        LED positions, sensor frame.
    x_mm, y_mm : (columns,), (rows,)
        Node positions, sensor frame.
    """

    u_px: Map
    v_px: Map
    gain: Map
    lookup: Map
    lookup_scale: Map
    coverage: Map
    leds_mm: Map
    x_mm: Map
    y_mm: Map


@dataclass(frozen=True, slots=True)
class SlopeField:
    """Slopes of the depth, with the flags of each node.

    Attributes
    ----------
    slope_x, slope_y : (rows, columns) float32
        d(depth)/dx and d(depth)/dy.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.

    Slopes that were not requested have size 0.
    """

    slope_x: Map
    slope_y: Map
    flags: NDArray[np.uint8]


class SlopeSolver:
    """Solves Eq. (10) for images of one sensor; constant data are prepared once.

    Several threads can call it; they then wait for each other.

    Parameters
    ----------
    maps : ShadingMaps
        The calibration.
    workers : RowWorkers
        Threads; each takes blocks of rows, so that the result does not depend on their number.
    """

    def __init__(self, maps: ShadingMaps, workers: RowWorkers) -> None:
        self._shape = maps.u_px.shape
        self._static, self._lit = _blocks(maps)
        self._table = _steps(maps.lookup)
        self._scale = maps.lookup_scale
        self._coverage = tuple((low, high) for low, high in maps.coverage)
        self._leds = tuple(tuple(led) for led in maps.leds_mm)
        self._x_first = float(maps.x_mm[0])
        self._pitch = float(maps.x_mm[-1] - maps.x_mm[0]) / max(maps.x_mm.size - 1, 1)
        self._y_mm = maps.y_mm
        self._workers = workers
        self._take = Buffers().take
        self._lock = Lock()

    def divergence(
        self,
        raw: NDArray[Any],
        solver: PoissonSolver,
        *,
        slopes: bool = False,
        gain: Gain | None = None,
    ) -> tuple[Map, SlopeField]:
        """Return the divergence of the slopes for `solver`, and the slopes if requested.

        Parameters
        ----------
        raw : (height, width, 3) uint8, uint16 or float32
            Raw image in RGB order; float images are 0..1.
        solver : PoissonSolver
            Of the same grid, in single precision.
        slopes : bool, optional
            Whether the slopes are returned, too.
        gain : (3,), optional
            Light of each channel over that at calibration.
        """
        shape = self._shape if slopes else (0, 0)
        slope_x, slope_y = np.empty(shape, np.float32), np.empty(shape, np.float32)
        flags = np.empty(self._shape, np.uint8)
        edges = solver.edges
        field = np.empty((len(edges.weight_y), len(edges.weight_x)), np.float32)
        with self._lock:
            self._workers.run(
                len(field),
                paper_divergence_rows,
                *self._of_image(raw, gain),
                (edges.start_x, edges.weight_x, edges.start_y, edges.weight_y),
                edges.top,
                edges.left,
                slopes,
                slope_x,
                slope_y,
                flags,
                field,
            )
        return field, SlopeField(slope_x, slope_y, flags)

    def _of_image(
        self, raw: NDArray[Any], gain: Gain | None
    ) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return an image and the sensor in the form for the kernels."""
        height, width = raw.shape[:2]
        # numba would compile the kernel a second time for a read-only array.
        raw = np.require(raw, requirements=["C", "W"])
        full_scale = np.float32(1.0 if raw.dtype.kind == "f" else np.iinfo(raw.dtype).max)
        pairs = self._pairs(raw) if raw.dtype == np.uint8 and width > 1 else None
        limit = np.float32(SATURATED) * full_scale
        scale = self._scale if gain is None else (self._scale / gain).astype(np.float32)
        sensor = (
            self._static,
            self._lit,
            self._table,
            tuple(scale / full_scale),
            self._coverage,
            self._leds,
            self._x_first,
            self._pitch,
            self._y_mm,
        )
        return (raw.reshape(-1, 3), pairs, width, height, limit), sensor

    def _pairs(self, raw: NDArray[np.uint8]) -> NDArray[np.uint64]:
        """Return (pixels,): of each pixel its three bytes and those of its right neighbour.

        The words overlap, as each neighbour has its own.
        """
        height, width = raw.shape[:2]
        words = self._take("words", (height * width + 1,), np.uint32)
        pixels = words[:-1].view(np.uint8).reshape(height, width, 4)
        cv2.cvtColor(raw, cv2.COLOR_RGB2RGBA, dst=pixels)
        return np.ndarray((height * width,), np.uint64, words, strides=(4,))


def _blocks(maps: ShadingMaps) -> tuple[Map, NDArray[np.bool_]]:
    """Return pixels and gains, block by block, and which blocks have usable nodes.

    Unusable nodes have gain 0.
    """
    rows, columns = maps.u_px.shape
    count = -(-columns // BLOCK)
    usable = (maps.gain > 0.0).all(axis=2) & (maps.u_px >= 0.0) & (maps.v_px >= 0.0)
    planes = np.zeros((STATIC_PLANES, rows, count * BLOCK), np.float32)
    planes[:2, :, :columns] = np.where(usable, np.stack([maps.u_px, maps.v_px]), 0.0)
    planes[2:, :, :columns] = np.where(usable, np.moveaxis(maps.gain, 2, 0), 0.0)
    parted = planes.reshape(STATIC_PLANES, rows, count, BLOCK).transpose(1, 2, 0, 3)
    lit = np.asarray((parted[:, :, 2] > 0.0).any(axis=2), np.bool_)
    static = np.ascontiguousarray(parted, np.float32)
    return static.reshape(rows, count, STATIC_PLANES * BLOCK), lit


def _steps(lookup: Map) -> NDArray[np.uint64]:
    """Return (3 * size,): of each entry its cosine and the step to the next, half a word each."""
    both = np.zeros((*lookup.shape, 2), np.float32)
    both[..., 0] = lookup
    both[:, :-1, 1] = np.diff(lookup, axis=1)
    return both.view(np.uint64).ravel()
