"""Solves a region: rounds at the coarsest scale, and the last round at the scale of the effort."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from gelpolight_core.arrays import Map, Mask
from gelpolight_core.light.contact import ContactLight, contact_light
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.checks import MOST_PITCH
from gelpolight_core.reconstruction.height_map import COARSE
from gelpolight_core.reconstruction.integration.weighted import (
    FREE,
    WeightedIntegration,
    integrate_weighted,
)
from gelpolight_core.reconstruction.near_light.boundary import (
    Boundary,
    find_boundary,
    region_strips,
)
from gelpolight_core.reconstruction.near_light.from_around import (
    FromAround,
    surface_normals,
    with_surroundings,
)
from gelpolight_core.reconstruction.near_light.kernel import (
    UNSOLVED_WEIGHT,
    left_rows,
    solve_rows,
    uneven_rows,
)
from gelpolight_core.reconstruction.near_light.maps import SensorMaps
from gelpolight_core.reconstruction.near_light.ratio_sampler import Compared
from gelpolight_core.reconstruction.near_light.settings import Settings
from gelpolight_core.reconstruction.near_light.structures import (
    RatioImage,
    Region,
    Scale,
    Slopes,
    Steps,
    slopes_like,
)
from gelpolight_core.reconstruction.terms import Terms
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.sensor_calibration import FullModel

LONGEST_STEP = 0.2
"""A round may not move the surface by more than this share of the LEDs' height: light that is
frozen further away says next to nothing about the slopes there."""
HELD_ROUNDS = 10
"""Rounds at most, after a step was held back."""
SETTLED = 0.05
"""Share of the longest step below which held rounds have settled."""
THIN = 2
"""Step along both axes of the nodes that are counted as solved or unsolved."""


@dataclass(frozen=True, slots=True)
class Rounds:
    """The depth after the rounds, and how they ended.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Along the rays.
    changes_mm : tuple of float
        Largest change of the depth in each round.
    stopped : str
        ``done``; ``damped`` when steps were limited and the rounds converged;
        ``grows`` when the last change was larger than the one before and that round was undone;
        ``unsettled`` when damped rounds did not end.
    """

    depth_mm: Map
    changes_mm: tuple[float, ...]
    stopped: str


class SolvedRegion(NamedTuple):
    """A solved region at the scale of its last round, in the buffers of the solver.

    Attributes
    ----------
    region : Region
        Where.
    compared : Compared
        The image there.
    scale : Scale
        Of the last round.
    start_mm : (rows, columns) float32
        Depth along the rays at which the last round was solved.
    slopes : Slopes
        Of the last round.
    depth_mm : (rows, columns) float32
        Along the rays.
    weight, hold : (rows, columns) float32; hold None where the border is held everywhere
        Of the integration.
    boundary : Boundary
        Where depth 0 is held.
    position : (2, rows, columns) float32
        Room for column and row of the ray that sees each true position.
    integration_rounds : int
        Of the last integration.
    """

    region: Region
    compared: Compared
    scale: Scale
    start_mm: Map
    slopes: Slopes
    depth_mm: Map
    weight: Map
    hold: Map | None
    boundary: Boundary
    position: Map
    integration_rounds: int


class Start(NamedTuple):
    """Results of the rounds at the coarsest scale, for the last round.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Along the rays.
    normals : 2 of (rows, columns) float32, or None
        x and y of the last normals; None where no round was done.
    boundary : Boundary
        Where depth 0 is held.
    around : 2 of (3, rows, columns) float32, or None
        Interreflected light and clearance of the lights; None without interreflection.
    """

    depth_mm: Map
    normals: tuple[Map, Map] | None
    boundary: Boundary
    around: tuple[Map, Map] | None = None


class Weighted(NamedTuple):
    """Slopes with the weights (rows, columns) and the hold of their integration."""

    slopes: Slopes
    weight: Map
    hold: Map | None


class RegionSolver:
    """Solves regions of one sensor.

    Parameters
    ----------
    maps : SensorMaps
        The sensor's.
    workers : RowWorkers
        Threads.
    buffers : Buffers
        Memory for its results, used again for each frame.
    from_around : FromAround
        Light and shadows of the membrane on itself.
    """

    def __init__(
        self, maps: SensorMaps, workers: RowWorkers, buffers: Buffers, from_around: FromAround
    ) -> None:
        self.maps = maps
        self._workers = workers
        self._take = buffers.take
        self._longest_mm = longest_step_mm(maps.full)
        self._from_around = from_around

    def rounds(
        self, region: Region, compared: Compared, settings: Settings, terms: Terms
    ) -> tuple[Rounds, Start]:
        """Return the rounds at the coarsest scale, and the start of the last round.

        With interreflection, further rounds include it.
        """
        at = (self.maps.scale(COARSE), region.corner)
        reflected = self.maps.membrane.interreflection > 0.0
        normals: tuple[Map, Map] | None = None
        boundary = None if terms.free_boundary and terms.weights else Boundary()
        tolerances = list(settings.round_tolerances)

        def solve(depth: Map) -> Map:
            nonlocal normals, boundary
            slopes = self.slopes(at, compared.coarse, depth, settings, terms, normals)
            normals = slopes.normal_x, slopes.normal_y
            tolerance = tolerances.pop(0) if len(tolerances) > 1 else tolerances[0]
            # Interreflection makes walls too flat at first: they do not determine the boundary.
            known = Boundary() if reflected else boundary
            found, known = self._bounded(region, slopes, depth, known, (tolerance, settings, terms))
            boundary = boundary if reflected else known
            return found

        rounds = near_light_rounds(
            solve,
            region.shape,
            longest_mm=self._longest_mm,
            wanted=terms.near_light_rounds,
            shallow_mm=settings.shallow_mm,
        )
        if reflected and normals is not None:
            surface = (rounds.depth_mm, *normals)
            return rounds, self._with_around(region, compared, surface, boundary, settings, terms)
        return rounds, Start(rounds.depth_mm, normals, boundary or Boundary())

    def _bounded(
        self,
        region: Region,
        slopes: Slopes,
        depth: Map,
        boundary: Boundary | None,
        how: tuple[float, Settings, Terms],
    ) -> tuple[Map, Boundary]:
        """Integrate a coarse round; find the free boundary if it is not known yet."""
        scale, (tolerance, settings, terms) = self.maps.scale(COARSE), how

        def integrated(free: Mask | None, tolerance: float = tolerance) -> Map:
            weighted = _weighted(scale, region.corner, slopes, free)
            return self._integrated(scale, weighted, depth, tolerance, terms).depth_mm

        if boundary is not None:
            return boundary.levelled(integrated(boundary.free)), boundary
        held = integrated(None)
        strips = region_strips(self.maps.rim_distance_mm, region, scale.pitch_mm)
        fine = partial(integrated, tolerance=settings.round_tolerances[-1])
        boundary = find_boundary(held, strips, fine, scale.pitch_mm)
        found = held if boundary.free is None else boundary.levelled(integrated(boundary.free))
        return found, boundary

    def _with_around(
        self,
        region: Region,
        compared: Compared,
        surface: tuple[Map, Map, Map],
        boundary: Boundary | None,
        settings: Settings,
        terms: Terms,
    ) -> Start:
        """Return a start with the interreflected light and the shadows of its own surface.

        Interreflection makes walls look flatter, and flatter walls reflect less light. The first
        rounds therefore use a membrane that absorbs no light, so that the others start from walls
        that are too steep.
        """
        scale, (top, left), (rows, columns) = self.maps.scale(COARSE), *region.at(1)
        at = np.s_[top : top + rows, left : left + columns]
        depth, own = surface[0], self.maps.full.membrane.interreflection
        how = (settings.round_tolerances[-1], settings, terms)
        for number in range(settings.around_rounds):
            # The first two rounds take a membrane that absorbs no light.
            steep = number < 2
            around = self._from_around.on(
                region, compared.coarse.ratio, surface, max(own, 1.0) if steep else own
            )
            begin = surface_normals(depth, at, scale)
            image = with_surroundings(compared.coarse, compared.coarse, *around)
            slopes = self.slopes((scale, (top, left)), image, depth, settings, terms, begin)
            known = Boundary() if steep else boundary
            found, known = self._bounded(region, slopes, depth, known, how)
            boundary = boundary if steep else known
            depth = held_back(depth, found, self._longest_mm).copy()
            surface = (depth, slopes.normal_x.copy(), slopes.normal_y.copy())
        around = self._from_around.on(region, compared.coarse.ratio, surface, own)
        begin = surface_normals(depth, at, scale)
        return Start(depth, begin, boundary or Boundary(), around)

    def last_slopes(
        self,
        region: Region,
        compared: Compared,
        start: Start,
        settings: Settings,
        terms: Terms,
    ) -> tuple[Compared, Map, Slopes]:
        """Solve at the scale of the settings, from depth and normals of the coarsest one.

        Returns what was solved, with interreflected light; the depth at which, and the slopes.
        """
        corner, shape = region.at(COARSE // settings.factor)
        depth = _enlarged(start.depth_mm, shape)
        known = start.normals
        normals = None if known is None else tuple(_enlarged(n, shape) for n in known)
        at = (self.maps.scale(settings.factor), corner)
        if start.around is not None:
            lit = with_surroundings(compared.fine, compared.coarse, *start.around)
            compared = compared._replace(fine=lit)
        slopes = self.slopes(at, compared.fine, depth, settings, terms, normals)
        return compared, depth, slopes

    def last_depth(
        self,
        region: Region,
        solved: tuple[Compared, Map, Slopes],
        boundary: Boundary,
        settings: Settings,
        terms: Terms,
    ) -> SolvedRegion:
        """Integrate what :meth:`last_slopes` has returned."""
        (compared, depth, slopes), scale = solved, self.maps.scale(settings.factor)
        corner, shape = region.at(COARSE // settings.factor)
        weighted = _weighted(scale, corner, slopes, boundary.free)
        found = self._integrated(scale, weighted, depth, settings.tolerance, terms)
        return SolvedRegion(
            region,
            compared,
            scale,
            depth,
            slopes,
            held_back(depth, boundary.levelled(found.depth_mm), self._longest_mm),
            weighted.weight,
            weighted.hold,
            boundary,
            self._take("place", (2, *shape)),
            found.rounds,
        )

    def slopes(
        self,
        at: tuple[Scale, tuple[int, int]],
        image: RatioImage,
        depth: Map,
        settings: Settings,
        terms: Terms,
        start: tuple[Map, ...] | None,
    ) -> Slopes:
        """Return slopes at the present depth; normals to start from, if any, are overwritten."""
        slopes = slopes_like(depth, self._take)
        if start is not None:
            slopes = slopes._replace(normal_x=start[0], normal_y=start[1])
        steps = Steps(settings.steps, settings.settled**2, terms.shadows, start is not None)
        rows, membrane = len(depth), self.maps.membrane
        self._workers.run(rows, solve_rows, image, depth, *at, membrane, steps, slopes)
        if not terms.ray_true_slopes:
            down = -np.sqrt(1.0 - slopes.normal_x**2 - slopes.normal_y**2)
            slopes.slope_x[:], slopes.slope_y[:] = slopes.normal_x / down, slopes.normal_y / down
            if at[0].rest is not None:
                (top, left), (rows, columns) = at[1], depth.shape
                here = at[0].rest[:, top : top + rows, left : left + columns]
                slopes.slope_x[:] += here[1]
                slopes.slope_y[:] += here[2]
        return slopes

    def left_over(self, solved: SolvedRegion) -> ContactLight:
        """Return what a solved surface leaves of the light, and of the slopes, of its contact."""
        scale, misfit = solved.scale, self.maps.full.misfit
        step = max(round(0.5 * self.maps.full.decay_mm / scale.pitch_mm), 1)
        rows, columns = solved.depth_mm.shape
        left = np.empty((4, rows // step, columns), np.float32)
        corner = solved.region.at(COARSE // scale.factor)[0]
        found = (scale, corner, self.maps.membrane, solved.slopes)
        image, start = solved.compared.fine, solved.start_mm
        self._workers.run(rows // step, left_rows, image, start, *found, step, left)
        uneven = np.empty((2, rows // step, columns // step), np.float32)
        surface = (solved.slopes, solved.depth_mm, np.float32(scale.pitch_mm), step)
        self._workers.run(uneven.shape[1], uneven_rows, *surface, uneven)
        # Where nodes do not resolve the drape, a node at an edge has no single normal.
        coarse = scale.pitch_mm / self.maps.full.decay_mm
        level = math.hypot(misfit, coarse**2 / 8.0)
        return contact_light(left, step, uneven, level, resolved=coarse <= MOST_PITCH)

    def _integrated(
        self, scale: Scale, weighted: Weighted, depth: Map, tolerance: float, terms: Terms
    ) -> WeightedIntegration:
        slopes, weight, hold = weighted
        return integrate_weighted(
            slopes.slope_x,
            slopes.slope_y,
            weight if terms.weights else np.ones_like(weight),
            pitch_mm=scale.pitch_mm,
            start_mm=depth if depth.any() else None,
            hold=hold if terms.weights else None,
            tolerance=tolerance,
            workers=self._workers,
        )


def unsolved_share(solved: SolvedRegion) -> float:
    """Return the share of nodes of the field that the light does not determine, from a sample."""
    kind, factor = solved.scale.kind, solved.scale.factor
    (top, left), (rows, columns) = solved.region.at(COARSE // factor)
    usable = kind[top : top + rows : THIN, left : left + columns : THIN] == 2
    unsolved = usable & (solved.slopes.weight[::THIN, ::THIN] <= np.float32(UNSOLVED_WEIGHT))
    every = np.count_nonzero(kind[::THIN, ::THIN] == 2)
    return float(np.count_nonzero(unsolved)) / max(int(every), 1)


def _weighted(scale: Scale, corner: tuple[int, int], slopes: Slopes, free: Mask | None) -> Weighted:
    """Return the weights, and the weight of depth 0 at the border (None: 1 everywhere)."""
    weight = slopes.weight
    if free is None:
        return Weighted(slopes, weight, None)
    (top, left), (rows, columns) = corner, weight.shape
    repeat = rows // free.shape[0]
    here = np.repeat(np.repeat(free, repeat, axis=0), repeat, axis=1)
    hold = np.where(here, np.float32(FREE), np.float32(1.0))
    inside = scale.kind[top : top + rows, left : left + columns] > 0
    return Weighted(slopes, np.where(inside, weight, weight * hold), hold)


def _enlarged(values: Map, shape: tuple[int, int]) -> Map:
    """Return a map at a finer scale."""
    if values.shape == shape:
        return values
    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_LINEAR))


def near_light_rounds(
    solve: Callable[[Map], Map],
    shape: tuple[int, ...],
    *,
    longest_mm: float,
    wanted: int,
    shallow_mm: float = 0.0,
) -> Rounds:
    """Repeat a round the wanted number of times, and after damping until the depth converges.

    Parameters
    ----------
    solve : function of the present depth (rows, columns)
        One round: returns the depth that the slopes at the present depth give.
    shape : tuple of int
        Of the depth, which starts at 0.
    longest_mm : float
        How far a round may move the surface.
    wanted : int
        Rounds.
    shallow_mm : float, optional
        One round is enough where it moves the surface by less.
    """
    depth = np.zeros(shape, np.float32)
    changes: list[float] = []
    stopped = "unsettled" if wanted else "done"
    for _ in range(HELD_ROUNDS if wanted else 0):
        solved = solve(depth)
        changes.append(float(np.abs(solved - depth).max()))
        if len(changes) > 1 and changes[-1] > changes[-2]:
            stopped = "grows"
            break
        depth = held_back(depth, solved, longest_mm)
        held = max(changes) > longest_mm
        enough = len(changes) >= wanted or changes[-1] < shallow_mm
        if enough and (not held or changes[-1] <= SETTLED * longest_mm):
            stopped = "damped" if held else "done"
            break
    return Rounds(depth, tuple(changes), stopped)


def longest_step_mm(full: FullModel) -> float:
    """Return how far one round may move the surface."""
    return LONGEST_STEP * float(np.abs(full.led_positions_mm[:, 2]).min())


def held_back(depth_mm: Map, solved_mm: Map, longest_mm: float) -> Map:
    """Return the solved depth, or a part of the step to it if the step is too long."""
    step = solved_mm - depth_mm
    longest = float(np.abs(step).max())
    if longest <= longest_mm:
        return solved_mm
    return np.asarray(depth_mm + np.float32(longest_mm / longest) * step)
