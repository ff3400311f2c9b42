"""A solved region with the residual of its image."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.health.contact_residual import ContactLightResidual, contact_light
from gelpolight_core.reconstruction.frame_checks import MOST_PITCH
from gelpolight_core.reconstruction.height_map import COARSE

from .boundary_condition import BoundaryCondition
from .damped_rounds import LightRounds
from .kernel import UNSOLVED_WEIGHT, integrability_rows, residual_rows
from .kernel_structures import GridRegion, PyramidLevel, RegionSlopes
from .ratio_sampler import RatioPyramid
from .sensor_maps import SensorMaps

THIN = 2
"""Step along both axes of the nodes that are counted as solved or unsolved."""


class SolvedRegion(NamedTuple):
    """A solved region at the scale of its last round, in the buffers of the solver.

    Attributes
    ----------
    region : GridRegion
        Nodes that were solved.
    compared : RatioPyramid
        Press over background, with interreflection.
    scale : PyramidLevel
        Scale of the last round.
    start_mm : (rows, columns) float32
        Depth along the rays at which the last round was solved.
    slopes : RegionSlopes
        Slopes of the last round.
    depth_mm : (rows, columns) float32
        Depth along the rays.
    weight, hold : (rows, columns) float32; hold None where the border is held everywhere
        Weights of the integration, and of depth 0 at the border.
    boundary : BoundaryCondition
        Nodes at which depth 0 is held.
    position : (2, rows, columns) float32
        Column and row of the ray that sees each true position, written by `place_region`.
    stopped : str
        Why the rounds at the coarsest scale ended: `DampedRounds.stopped`.
    light_rounds : LightRounds
        Last rounds, with their moves.
    """

    region: GridRegion
    compared: RatioPyramid
    scale: PyramidLevel
    start_mm: Float32Array
    slopes: RegionSlopes
    depth_mm: Float32Array
    weight: Float32Array
    hold: Float32Array | None
    boundary: BoundaryCondition
    position: Float32Array
    stopped: str
    light_rounds: LightRounds

    @property
    def unsolved_share(self) -> float:
        """Fraction of the nodes of the field that the light does not determine, from a sample."""
        kind = self.scale.kind
        window = self.region.window(COARSE // self.scale.factor)
        usable = kind[window][::THIN, ::THIN] == 2
        unsolved = usable & (self.slopes.weight[::THIN, ::THIN] <= np.float32(UNSOLVED_WEIGHT))
        field_nodes = np.count_nonzero(kind[::THIN, ::THIN] == 2)
        return float(np.count_nonzero(unsolved)) / max(int(field_nodes), 1)


def solution_residual(
    solved: SolvedRegion, maps: SensorMaps, workers: RowThreadPool
) -> ContactLightResidual:
    """Return the light and the slopes of the contact that the surface does not explain."""
    scale, full = solved.scale, maps.full
    step = max(round(0.5 * full.decay_mm / scale.pitch_mm), 1)
    rows, columns = (n // step for n in solved.depth_mm.shape)
    light = np.empty((5, rows, solved.depth_mm.shape[1]), np.float32)
    corner = solved.region.at(COARSE // scale.factor)[0]
    surface = (solved.start_mm, scale, corner, maps.membrane, solved.slopes)
    workers.run(rows, residual_rows, solved.compared.fine, *surface, step, light)
    uneven = np.empty((2, rows, columns), np.float32)
    pitch_mm = np.float32(scale.pitch_mm)
    workers.run(rows, integrability_rows, solved.slopes, solved.depth_mm, pitch_mm, step, uneven)
    # Where nodes do not resolve the drape, a node at an edge has no single normal.
    coarse = scale.pitch_mm / full.decay_mm
    level = math.hypot(full.misfit, coarse**2 / 8.0)
    x_mm, y_mm = (
        first + scale.pitch_mm * (start + step * (np.arange(number) + 0.5))
        for first, start, number in zip(
            (scale.x_mm, scale.y_mm), corner[::-1], (columns, rows), strict=True
        )
    )
    squares_mm = x_mm, y_mm
    return contact_light(light, step, uneven, level, squares_mm, resolved=coarse <= MOST_PITCH)
