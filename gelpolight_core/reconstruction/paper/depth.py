"""From one image to depth by the paper's model: slopes, their divergence, integration."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.lights.positions import light_directions
from gelpolight_core.masks import usable
from gelpolight_core.reconstruction.checks import (
    NearBoundary,
    fixed_boundary_note,
    nodes_near_boundary,
    paper_notes,
    refuse_coplanar_lights,
    refuse_dark_membrane,
)
from gelpolight_core.reconstruction.height_map import (
    Flag,
    HeightMap,
    normals_from_slopes,
    surface_slopes,
)
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.linear import linearised
from gelpolight_core.reconstruction.paper.kernel import blank_rows
from gelpolight_core.reconstruction.paper.model import (
    ShadingMaps,
    SlopeSolver,
)
from gelpolight_core.reconstruction.solver import (
    OpenSolver,
    Solved,
    Wanted,
    thinned,
)
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.reconstruction.trace import Trace, TraceStep
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
LOOKUP_SIZE = 2048
PAPER_REASON = tr("the paper's model has one mode")
PAPER_STEPS = (tr("resampling, normals and their divergence"), tr("integration"))


class PaperSolver(OpenSolver):
    """Reconstructs frames by the paper's model.

    Parameters
    ----------
    calibration : Calibration
        The sensor's.
    workers : int
        Threads.
    """

    visible_mm = None

    def __init__(self, calibration: Calibration, *, workers: int) -> None:
        known = usable(calibration.table.valid, calibration.radiance, calibration.factors)
        super().__init__(calibration, calibration.led_positions_mm, known)
        self.maps = shading_maps(calibration)
        grid = calibration.table.grid
        self.integration = PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=workers)
        self._threads = RowWorkers(workers)
        self.slopes = SlopeSolver(self.maps, self._threads)

    @staticmethod
    def refuse_unfit(calibration: Calibration) -> None:
        """Refuse lights nearly in one plane, and a membrane without light."""
        refuse_coplanar_lights(calibration, calibration.led_positions_mm)
        refuse_dark_membrane(calibration, calibration.radiance)

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

    def needs(self, frame: NDArray[Any], wanted: Wanted) -> Trace:
        """Return which steps a frame needs; see :class:`Solver`."""
        record = wanted.record()
        record.steps += [TraceStep(step, True, PAPER_REASON) for step in PAPER_STEPS]
        return Trace(wanted.effort, tuple(record.steps))

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Map:
        """Return the image of a surface by Eq. 6, with the light of the flat membrane."""
        at, calibration = thinned(step), self.calibration
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
        return np.asarray(np.where(self._known[at][..., None], ratio, np.nan), np.float32)

    def depth(self, frame: NDArray[Any], wanted: Wanted) -> Solved:
        """Reconstruct a frame; see :class:`Solver`."""
        light, record = frame, wanted.record()
        response = self.calibration.response
        if response is not None and frame.dtype.kind != "f":
            with record.done(tr("linear light"), frame.nbytes) as reason:
                light = linearised(frame, response)
                reason.append(tr("the camera's response is not linear"))
        with record.done(PAPER_STEPS[0], frame.nbytes) as reason:
            divergence, field = self.slopes.divergence(
                light, self.integration, slopes=wanted.normals, gain=wanted.gain
            )
            reason.append(PAPER_REASON)
        with record.done(PAPER_STEPS[1], 2 * divergence.nbytes) as reason:
            depth_mm = self.integration.depth_of(divergence)
            self._threads.run(len(depth_mm), blank_rows, field.flags, depth_mm)
            reason.append(PAPER_REASON)
        if not wanted.normals:
            record.left_out(tr("normals"), tr("not requested"))
        record.left_out(tr("standard deviations"), tr("the paper's model states none"))
        normals = normals_from_slopes(field.slope_x, field.slope_y) if wanted.normals else None
        depth_mm = np.asarray(depth_mm, np.float32)
        height_mm = float(-self.calibration.led_positions_mm[:, 2].max())
        notes = (*self._condition_notes, *paper_notes(depth_mm, field.flags, height_mm))
        if self.boundary_nodes.pressed(depth_mm):
            notes += (fixed_boundary_note(),)
            field.flags[(field.flags & np.uint8(Flag.OUTSIDE)) == 0] |= np.uint8(Flag.UNANCHORED)
        return Solved(
            depth_mm,
            normals,
            field.flags,
            notes,
            Trace(wanted.effort, tuple(record.steps)),
            lateral_per_mm=self.ray_spread_per_mm,
        )


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
