"""From one image to depth by the paper's model: slopes, their divergence, integration."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.masks import usable
from gelpolight_core.reconstruction.checks import (
    NearBoundary,
    Notes,
    fixed_boundary_note,
    nodes_near_boundary,
    paper_notes,
)
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.linear import linearised
from gelpolight_core.reconstruction.paper.kernel import blank_rows
from gelpolight_core.reconstruction.paper.model import (
    Gain,
    ShadingMaps,
    SlopeField,
    SlopeSolver,
    normals_from_slopes,
)
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.reconstruction.trace import TraceRecorder, TraceStep
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
LOOKUP_SIZE = 2048
PAPER_REASON = tr("the paper's model has one mode")
PAPER_STEPS = (tr("resampling, normals and their divergence"), tr("integration"))


class PaperDepth(NamedTuple):
    """A reconstruction by the paper's model.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Intersection of each ray with the undeformed surface.
    normals : (rows, columns, 3) float32 or None
        Unit normals, z < 0; None where they were not requested.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    notes : tuple of Note
        Notes for the user.
    steps : tuple of TraceStep
        What was done.
    """

    depth_mm: Map
    normals: Map | None
    flags: NDArray[np.uint8]
    notes: Notes
    steps: tuple[TraceStep, ...]


class PaperSolver:
    """Reconstructs frames by the paper's model.

    Parameters
    ----------
    calibration : Calibration
        The sensor's.
    workers : int
        Threads.
    """

    def __init__(self, calibration: Calibration, *, workers: int) -> None:
        self.calibration = calibration
        self.maps = shading_maps(calibration)
        grid = calibration.table.grid
        self.integration = PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=workers)
        self._threads = RowWorkers(workers)
        self._slopes = SlopeSolver(self.maps, self._threads)

    @cached_property
    def boundary_nodes(self) -> NearBoundary:
        """Nodes at which a contact across the boundary of the field is visible."""
        return nodes_near_boundary(self.calibration)

    @cached_property
    def ray_spread_per_mm(self) -> float:
        """Relative divergence of the rays per mm of depth."""
        table = self.calibration.table
        rows, columns = table.grid.shape
        here = np.s_[rows // 4 : 3 * rows // 4, columns // 4 : 3 * columns // 4]
        across = np.gradient(table.ray_slope[here][..., 0], axis=1)[table.valid[here]]
        return float(np.median(np.abs(across))) / table.grid.pitch_mm if across.size else 0.0

    def slopes(self, frame: NDArray[Any], gain: Gain | None) -> SlopeField:
        """Return the depth's slopes of a raw frame (height, width, 3).

        Parameters
        ----------
        frame, gain
            As in :meth:`depth`.
        """
        return self._slopes.solve(linearised(frame, self.calibration.response), gain=gain)

    def depth(self, frame: NDArray[Any], *, normals: bool, gain: Gain | None) -> PaperDepth:
        """Reconstruct a raw frame.

        Parameters
        ----------
        frame : (height, width, 3) uint8, uint16 or float32
            RGB, as the camera encodes it; floats linear light 0..1.
        normals : bool
            Whether they are wanted.
        gain : (3,) or None
            Light of each channel over that at calibration; None: the same.
        """
        light, record = frame, TraceRecorder()
        response = self.calibration.response
        if response is not None and frame.dtype.kind != "f":
            with record.done(tr("linear light"), frame.nbytes) as reason:
                light = linearised(frame, response)
                reason.append(tr("the camera's response is not linear"))
        with record.done(PAPER_STEPS[0], frame.nbytes) as reason:
            divergence, field = self._slopes.divergence(
                light, self.integration, slopes=normals, gain=gain
            )
            reason.append(PAPER_REASON)
        with record.done(PAPER_STEPS[1], 2 * divergence.nbytes) as reason:
            depth_mm = self.integration.depth_of(divergence)
            self._threads.run(len(depth_mm), blank_rows, field.flags, depth_mm)
            reason.append(PAPER_REASON)
        if not normals:
            record.left_out(tr("normals"), tr("not requested"))
        record.left_out(tr("standard deviations"), tr("the paper's model states none"))
        shown = normals_from_slopes(field.slope_x, field.slope_y) if normals else None
        depth_mm = np.asarray(depth_mm, np.float32)
        height_mm = float(-self.calibration.led_positions_mm[:, 2].max())
        notes = paper_notes(depth_mm, field.flags, height_mm)
        if self.boundary_nodes.pressed(depth_mm):
            notes += (fixed_boundary_note(),)
            field.flags[(field.flags & np.uint8(Flag.OUTSIDE)) == 0] |= np.uint8(Flag.UNANCHORED)
        return PaperDepth(depth_mm, shown, field.flags, notes, tuple(record.steps))


def shading_maps(calibration: Calibration) -> ShadingMaps:
    """Return the maps of a calibration in the form for the fused pass."""
    table = calibration.table
    strength = calibration.radiance * calibration.factors
    known = usable(table.valid, calibration.radiance, calibration.factors)
    gain = np.zeros_like(strength)
    gain[known] = 1.0 / strength[known]
    lookup, scale = calibration.reflectance.lookup(LOOKUP_SIZE)

    def single(array: NDArray[Any]) -> NDArray[np.float32]:
        return np.ascontiguousarray(array, dtype=np.float32)

    return ShadingMaps(
        table.u_px,
        table.v_px,
        single(gain),
        lookup,
        scale,
        single(calibration.reflectance.coverage),
        single(calibration.led_positions_mm),
        single(table.grid.x_mm),
        single(table.grid.y_mm),
    )
