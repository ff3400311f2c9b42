"""The near-light model: one solver for every scale and region.

The steps of a frame: its contact is found, press over background is sampled around it, rounds at
the coarsest scale find the depth, the last round is done at the scale of the effort, and the region
is moved to true positions. The efforts `fast`, `balanced` and `best` are parameter sets
(:mod:`.effort_parameters`). What a frame does not need is left out. The bounds on what that may
change are stated with each constant and held by tests.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial
from threading import Lock
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding
from gelpolight_core.health.contact_residual import ContactLightResidual
from gelpolight_core.image.coded import coded
from gelpolight_core.reconstruction.buffers import BufferPool
from gelpolight_core.reconstruction.frame_checks import (
    feedback_notes,
    free_boundary_note,
    refuse_unsolvable,
    rounds_notes,
    small_image_notes,
    too_coarse_notes,
    unanchored_note,
    unsolved_notes,
    visible_depth_notes,
)
from gelpolight_core.reconstruction.height_map import COARSE, Flag, HeightMap
from gelpolight_core.reconstruction.integration.weighted import (
    FREE,
    WeightedIntegrationResult,
    integrate_weighted,
)
from gelpolight_core.reconstruction.linearise import linearise_frame
from gelpolight_core.reconstruction.resolution import lost_at_top
from gelpolight_core.reconstruction.solver import (
    INTEGRATION,
    LOOKING,
    NOTHING_PRESSED,
    DepthNoise,
    DepthSolution,
    OpenSolver,
    SolveRequest,
    not_visible_reason,
)
from gelpolight_core.reconstruction.trace import EFFORTS, Trace, TraceRecorder, TraceStep
from gelpolight_core.sensor.sensor_calibration import OpenSensor

from .blended_frame import without_floor, without_frame_before
from .boundary_condition import BoundaryCondition, find_boundary, region_strips
from .contact_detection import AREA_SIGMAS, margin_mm, padded_region
from .damped_rounds import DampedRounds, LightRounds, limit_step, longest_step_mm
from .depth_uncertainty import depth_noise, no_contact_noise
from .effort_parameters import MOVED, RESOLVED, SETTINGS, EffortParameters
from .grid_resampling import place_region
from .image_noise import image_noise
from .kernel import solve_rows
from .kernel_structures import GaussNewtonOptions, GridRegion, RatioImage, RegionSlopes, slopes_like
from .membrane_interreflection import InterreflectionModel, SurfaceFacets, with_interreflection
from .ratio_sampler import RatioPyramid, RatioSampler, RawFrame
from .region_solution import SolvedRegion
from .sensor_maps import SensorMaps
from .surface_image import surface_image

WHOLE = 0.85
"""A region with this share of the grid is extended to all of it."""
AROUND_ROUNDS = 2
"""Rounds at quarter scale with the light that the membrane reflects onto itself, before those at
the scale of the effort."""
NEAR_LIGHT_ROUNDS = 2
"""Rounds at quarter scale, before the round at full scale. Each computes light directions, inverse
square law and lobe again at the depth found."""
SAMPLED_BYTES, SOLVED_BYTES, SHOWN_BYTES = 45, 88, 6
"""Bytes that a sampled, a solved and a shown node must read and write once."""
COMPARING = "resampling and comparing"
COARSE_ROUNDS = "near light, quarter scale"
PLACING = "true positions"
LAST_ROUND = {
    1: "near light, full scale",
    2: "near light, half scale",
    4: "near light, last round",
}


class RegionTask(NamedTuple):
    """A region to solve: its image and the parameters of the effort."""

    region: GridRegion
    compared: RatioPyramid
    settings: EffortParameters

    @property
    def nodes(self) -> int:
        """Number of nodes at the scale of the effort."""
        return self.region.nodes * (COARSE // self.settings.factor) ** 2


class CoarseSolution(NamedTuple):
    """Solution at the coarsest scale, from which the last round starts.

    Attributes
    ----------
    rounds : DampedRounds
        Rounds without interreflection.
    depth_mm : (rows, columns) float32
        Depth along the rays.
    normals : 2 of (rows, columns) float32, or None
        x and y of the last normals; None where no round was done.
    boundary : BoundaryCondition
        Nodes at which depth 0 is held.
    """

    rounds: DampedRounds
    depth_mm: Float32Array
    normals: tuple[Float32Array, Float32Array] | None
    boundary: BoundaryCondition


class NearLightSolver(OpenSolver):
    """Reconstructs frames by the near-light model, doing for each what it needs.

    Work buffers are kept from frame to frame; results are always new. It may be called from
    several threads, which then wait for each other. Results do not depend on the number of
    worker threads.

    Parameters
    ----------
    calibration : OpenSensor
        Calibrated data of the sensor, with its full model.
    workers : int
        Number of threads.
    settings : mapping, optional
        Parameters of each effort.
    """

    def __init__(
        self,
        calibration: OpenSensor,
        *,
        workers: int,
        settings: Mapping[str, EffortParameters] = SETTINGS,
    ) -> None:
        full = calibration.full
        assert full is not None
        self._settings = settings
        self.maps = SensorMaps(calibration, full)
        super().__init__(calibration, full.led_positions_mm, self.maps.usable, workers)
        buffers = BufferPool()
        self._take = buffers.take
        self._sampler = RatioSampler(self.maps, self.workers, buffers)
        self._around = InterreflectionModel(self.maps, self.workers)
        self._longest_mm = longest_step_mm(full)
        self._lock = Lock()

    def with_settings(self, settings: Mapping[str, EffortParameters]) -> NearLightSolver:
        """Return a solver with other settings that shares all data and buffers, for studies."""
        other = copy.copy(self)
        other._settings = settings
        return other

    @cached_property
    def visible_mm(self) -> float:
        """Smallest depth of a flat face that is found."""
        return self.finder(False).visible_mm

    @staticmethod
    def refuse_unfit(calibration: OpenSensor) -> None:
        """Refuse a calibration without full model, lights nearly in one plane, and no light."""
        full = calibration.full
        if full is None:
            raise InputError(
                "the calibration was made for the paper's model only",
                calibration.serial,
                Remedy.OTHER_MODEL,
            )
        refuse_unsolvable(calibration, full.led_positions_mm, full.background)

    def depth(self, frame: NDArray[Any], request: SolveRequest) -> DepthSolution:
        """Reconstruct a frame, as :meth:`Solver.depth`."""
        request, record = self._begin(request)
        depth = np.zeros(self.maps.flags.shape, np.float32)
        flags = self.maps.flags.copy()
        normals = self.maps.normals_at_rest.copy() if request.normals else None
        noise, notes = None, list(self._condition_notes)
        grid = self.calibration.table.grid
        with self._lock:
            image = self._image(frame, request)
            region = self._region(image, record, request.everywhere)
            if region is None:
                _nothing_pressed(record)
                noise = no_contact_noise(depth.shape) if request.uncertainty else None
                notes += visible_depth_notes(self.visible_mm)
            else:

                def solve(share: float, *, trial: bool = False) -> SolvedRegion:
                    steps = request.record() if trial else record
                    return self._solve(image._replace(blended=share), region, request, steps)

                found = without_frame_before(solve, self.maps, self.workers)
                solved, residual = found.solved, found.residual
                notes += [*found.findings, *self._notes(solved, residual)]
                with record.add_done(PLACING, depth.size * SHOWN_BYTES) as reason:
                    place_region(
                        solved,
                        self.maps.kind,
                        (depth, flags, normals),
                        self.workers,
                        self._take,
                    )
                    if solved.boundary.level_sd_mm > 0.0:
                        flags[(flags & np.uint8(Flag.OUTSIDE)) == 0] |= np.uint8(Flag.UNANCHORED)
                    reason.append("and to the scale of the whole grid")
                if request.uncertainty:
                    with record.add_done("standard deviations", depth.nbytes) as reason:
                        noise = self._noise(image, solved, residual, request, found.share_sd)
                        reason.append("requested")
        if not request.normals:
            record.add_skipped("normals", "not requested")
        if not request.uncertainty:
            record.add_skipped("standard deviations", "not requested")
        errors, blur_px = self.calibration.length_errors, self.calibration.lens_blur_px
        return DepthSolution(
            depth,
            normals,
            flags,
            tuple(notes),
            Trace(request.effort, tuple(record.steps)),
            noise,
            depth_scale_sd=None if errors is None else errors.depth,
            lateral_scale_sd=None if errors is None else errors.lateral,
            visible_depth_mm=None if request.everywhere else self.visible_mm,
            image_blur_mm=None if blur_px is None else blur_px * grid.pitch_mm,
        )

    def needs(self, frame: NDArray[Any], request: SolveRequest) -> Trace:
        """Return which steps a frame needs, by looking for a contact only."""
        request, record = self._begin(request)
        factor = self._settings[request.effort].factor
        with self._lock:
            region = self._region(self._image(frame, request), record, request.everywhere)
        if region is None:
            _nothing_pressed(record)
        else:
            names = (COMPARING, COARSE_ROUNDS, LAST_ROUND[factor], INTEGRATION, PLACING)
            record.steps += [TraceStep(n, True, "a contact was found") for n in names]
            self._left_out(record, factor)
        return Trace(request.effort, tuple(record.steps))

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Float32Array:
        """Return the image of a surface by the whole model, as :meth:`Solver.predict`."""
        return surface_image(height_map, self.maps, self._around, step)

    def effort_for(self, effort: str) -> str:
        """Return the effort, or the first finer one whose nodes resolve the membrane's drape."""
        pitch_mm, decay_mm = self.calibration.table.grid.pitch_mm, self.maps.full.decay_mm
        finer = EFFORTS[EFFORTS.index(effort) :]
        fits = (e for e in finer if self._settings[e].factor * pitch_mm <= RESOLVED * decay_mm)
        return next(fits, EFFORTS[-1])

    def _begin(self, request: SolveRequest) -> tuple[SolveRequest, TraceRecorder]:
        """Return the request with the effort that is used, and the record of the frame."""
        record = request.record()
        effort = request.effort
        used_effort = EFFORTS[-1] if request.uncertainty else self.effort_for(effort)
        if used_effort != effort and request.uncertainty:
            record.add_skipped(f"effort {effort}", f"standard deviations need {used_effort}")
        elif used_effort != effort:
            pitch_mm = self._settings[effort].factor * self.calibration.table.grid.pitch_mm
            why = "the images are too small: nodes of {p:.2f} mm are wider than the drape"
            record.add_skipped(f"effort {effort}", why.format(p=pitch_mm))
        return replace(request, effort=used_effort), record

    def _image(self, frame: NDArray[Any], request: SolveRequest) -> RawFrame:
        """Return a frame in whole numbers."""
        if request.effort == EFFORTS[-1]:
            # Camera values and linear light use the same code, so that both give the same depth.
            frame = linearise_frame(frame, self.calibration.response)
        return RawFrame(*coded(frame), request.gain)

    def _region(
        self, image: RawFrame, record: TraceRecorder, everywhere: bool
    ) -> GridRegion | None:
        """Return the region around the contact, or None where there is no contact."""
        if everywhere:
            record.add_skipped(LOOKING, "the whole field is requested")
            return self._whole
        with record.add_done(LOOKING, image.raw.nbytes) as reason:
            contact = self.finder(image.linear).find(image.raw, self.workers, image.gain)
            if contact is None:
                reason.append(not_visible_reason(self.visible_mm))
                return None
            region = padded_region(contact, self.maps.scale(COARSE), margin_mm(self.maps.full))
            share = region.nodes / self._whole.nodes
            reason.append(f"{share:.0%} of the field is solved")
        return self._whole if share > WHOLE else region

    @property
    def _whole(self) -> GridRegion:
        """The whole grid."""
        return GridRegion((0, 0), self.maps.scale(COARSE).kind.shape)

    def _solve(
        self, image: RawFrame, region: GridRegion, request: SolveRequest, record: TraceRecorder
    ) -> SolvedRegion:
        """Solve a region at the scale of the effort, from the depth at the coarsest scale."""
        task, start = self._coarse(image, region, request, record)
        if start.boundary.cut:
            record.add_skipped(
                LOOKING, "the contact extends beyond the region: the whole field is solved"
            )
            task, start = self._coarse(image, self._whole, request, record)
        (region, compared, settings), boundary = task, start.boundary
        factor, nodes = settings.factor, task.nodes
        shape = region.at(COARSE // factor)[1]
        if len(start.rounds.changes_mm) < NEAR_LIGHT_ROUNDS:
            record.add_skipped("second near-light round", "the press is shallow")
        reflects, moves = self.maps.membrane.interreflection > 0.0, LightRounds()
        depth, solved_mm = start.depth_mm, _enlarged(start.depth_mm, shape)
        while not moves.settled:
            with record.add_done(LAST_ROUND[factor], nodes * SOLVED_BYTES) as reason:
                depth, lit, normals = solved_mm, compared.fine, start.normals
                if reflects and normals is not None:
                    lit, normals = self._lit(task, factor, lit, depth)
                elif normals is not None:
                    normals = _enlarged(normals[0], shape), _enlarged(normals[1], shape)
                slopes = self._slopes(task, factor, lit, depth, normals)
                reason.append("from the depth of the round before")
            with record.add_done(INTEGRATION, 5 * nodes * 4) as reason:
                integral, weight, hold = self._integrate(
                    task, factor, slopes, depth, boundary.free, settings.tolerance
                )
                solved_mm = boundary.levelled(integral.depth_mm)
                solved_mm = limit_step(depth, solved_mm, self._longest_mm)
                reason.append(f"conjugate gradients, rounds: {integral.rounds}")
            moves.add(solved_mm - depth, factor, settings.most_rounds if reflects else 1)
        compared = compared._replace(fine=lit)
        self._left_out(record, factor)
        if factor < COARSE and compared.edge is None:
            record.add_skipped("denoising", "the image has almost no noise")
        if boundary.free is None:
            record.add_skipped("free boundary", "no contact crosses the boundary")
        return SolvedRegion(
            region,
            compared,
            self.maps.scale(factor),
            depth,
            slopes,
            solved_mm,
            weight,
            hold,
            boundary,
            self._take("place", (2, *shape)),
            start.rounds.stopped,
            moves,
        )

    def _lit(
        self, task: RegionTask, factor: int, image: RatioImage, depth_mm: Float32Array
    ) -> tuple[RatioImage, tuple[Float32Array, Float32Array]]:
        """Return an image with the light and shadows of a surface on itself, and its normals."""
        corner, scale = task.region.at(COARSE // factor)[0], self.maps.scale(factor)
        surface = SurfaceFacets.of(depth_mm, image.ratio, corner, scale, self.workers.run)
        light = self._around.light(task.region, surface)
        lit = with_interreflection(image, light, surface.normals)
        return lit, (surface.normals[0], surface.normals[1])

    def _coarse(
        self, image: RawFrame, region: GridRegion, request: SolveRequest, record: TraceRecorder
    ) -> tuple[RegionTask, CoarseSolution]:
        """Sample a region, and do the rounds at the coarsest scale."""
        settings = self._settings[request.effort]
        nodes = region.nodes * (COARSE // settings.factor) ** 2
        with record.add_done(COMPARING, nodes * SAMPLED_BYTES) as reason:
            compared = self._sampler.compare(image, region, settings.factor)
            if image.blended:
                fine, coarse = (
                    part._replace(ratio=without_floor(part.ratio, image.blended))
                    for part in (compared.fine, compared.coarse)
                )
                compared = compared._replace(fine=fine, coarse=coarse)
            task = RegionTask(region, compared, settings)
            reason.append("crosstalk and camera response are corrected in the same step")
        size = NEAR_LIGHT_ROUNDS * region.nodes * SOLVED_BYTES
        with record.add_done(COARSE_ROUNDS, size) as reason:
            start = self._start(task)
            count, deepest = len(start.rounds.changes_mm), float(start.rounds.depth_mm.max())
            reason.append(f"rounds: {count}; {deepest:.2f} mm deep")
            if self.maps.membrane.interreflection > 0.0:
                reason.append(f"{AROUND_ROUNDS} more with interreflection")
            if start.boundary.free is not None:
                reason.append("a contact crosses the boundary, which is free there")
        return task, start

    def _start(self, task: RegionTask) -> CoarseSolution:
        """Return the depth at the coarsest scale, after further rounds with interreflection."""
        settings = task.settings
        reflected = self.maps.membrane.interreflection > 0.0
        # Without interreflection walls are too flat: they do not determine the boundary.
        boundary = BoundaryCondition() if reflected else None
        normals: tuple[Float32Array, Float32Array] | None = None
        tolerances = settings.round_tolerances

        rounds = DampedRounds(
            np.zeros(task.region.shape, np.float32),
            self._longest_mm,
            NEAR_LIGHT_ROUNDS,
            settings.shallow_mm,
        )
        while not rounds.stopped:
            depth, number = rounds.depth_mm, len(rounds.changes_mm)
            slopes = self._slopes(task, COARSE, task.compared.coarse, depth, normals)
            normals = slopes.normal_x, slopes.normal_y
            tolerance = tolerances[min(number, len(tolerances) - 1)]
            solved_mm, boundary = self._bounded(task, slopes, depth, boundary, tolerance)
            rounds.add(solved_mm)
        if reflected and normals is not None:
            return self._with_around(task, rounds, normals)
        return CoarseSolution(rounds, rounds.depth_mm, normals, boundary or BoundaryCondition())

    def _with_around(
        self,
        task: RegionTask,
        rounds: DampedRounds,
        normals: tuple[Float32Array, Float32Array],
    ) -> CoarseSolution:
        """Return a start with the interreflected light and the shadows of its own surface."""
        depth, tolerance = rounds.depth_mm, task.settings.round_tolerances[-1]
        for number in range(AROUND_ROUNDS):
            image, normals = self._lit(task, COARSE, task.compared.coarse, depth)
            slopes = self._slopes(task, COARSE, image, depth, normals)
            # The first rounds are still too flat to find the boundary.
            known = BoundaryCondition() if number + 1 < AROUND_ROUNDS else None
            solved_mm, boundary = self._bounded(task, slopes, depth, known, tolerance)
            depth = limit_step(depth, solved_mm, self._longest_mm).copy()
        return CoarseSolution(rounds, depth, normals, boundary)

    def _bounded(
        self,
        task: RegionTask,
        slopes: RegionSlopes,
        depth: Float32Array,
        boundary: BoundaryCondition | None,
        tolerance: float,
    ) -> tuple[Float32Array, BoundaryCondition]:
        """Integrate a coarse round, and find the free boundary if it is not known yet."""

        def integrated(free: BoolArray | None, tolerance: float = tolerance) -> Float32Array:
            return self._integrate(task, COARSE, slopes, depth, free, tolerance)[0].depth_mm

        if boundary is not None:
            return boundary.levelled(integrated(boundary.free)), boundary
        held_mm, pitch_mm = integrated(None), self.maps.scale(COARSE).pitch_mm
        strips = region_strips(self.maps.rim_distance_mm, task.region, pitch_mm)
        fine = partial(integrated, tolerance=task.settings.round_tolerances[-1])
        found = slopes.slope_x, slopes.slope_y
        boundary = find_boundary(held_mm, strips, fine, pitch_mm, found, self.maps.full.decay_mm)
        if boundary.free is None:
            return held_mm, boundary
        return boundary.levelled(integrated(boundary.free)), boundary

    def _slopes(
        self,
        task: RegionTask,
        factor: int,
        image: RatioImage,
        depth: Float32Array,
        start: tuple[Float32Array, ...] | None,
    ) -> RegionSlopes:
        """Return slopes at the present depth. Normals to start from, if any, are overwritten."""
        scale, corner = self.maps.scale(factor), task.region.at(COARSE // factor)[0]
        settings = task.settings
        slopes = slopes_like(depth, self._take)
        if start is not None:
            slopes = slopes._replace(normal_x=start[0], normal_y=start[1])
        steps = GaussNewtonOptions(settings.steps, settings.settled**2, start is not None)
        surface = (depth, scale, corner, self.maps.membrane)
        self.workers.run(len(depth), solve_rows, image, *surface, steps, slopes)
        return slopes

    def _integrate(
        self,
        task: RegionTask,
        factor: int,
        slopes: RegionSlopes,
        depth: Float32Array,
        free: BoolArray | None,
        tolerance: float,
    ) -> tuple[WeightedIntegrationResult, Float32Array, Float32Array | None]:
        """Integrate slopes with a border that is free where a mask says so.

        Also returns the weights, and the weight of depth 0 at the border (None: 1 everywhere).
        """
        scale, weight, hold = self.maps.scale(factor), slopes.weight, None
        if free is not None:
            repeat = len(weight) // len(free)
            free = np.repeat(np.repeat(free, repeat, axis=0), repeat, axis=1)
            hold = np.where(free, np.float32(FREE), np.float32(1.0))
            inside = scale.kind[task.region.window(COARSE // factor)] > 0
            weight = np.where(inside, weight, weight * hold)
        integral = integrate_weighted(
            slopes.slope_x,
            slopes.slope_y,
            weight,
            pitch_mm=scale.pitch_mm,
            start_mm=depth if depth.any() else None,
            hold=hold,
            tolerance=tolerance,
            workers=self.workers,
        )
        return integral, weight, hold

    def _notes(self, solved: SolvedRegion, residual: ContactLightResidual) -> tuple[Finding, ...]:
        """Return why the depth of a solved region may be wrong."""
        boundary, noise_mm = solved.boundary, self.visible_mm / AREA_SIGMAS
        lit = solved.light_rounds
        pitch_mm, decay_mm = self.calibration.table.grid.pitch_mm, self.maps.full.decay_mm
        return (
            *residual.findings,
            *(() if boundary.free is None else (free_boundary_note(),)),
            *((unanchored_note(),) if boundary.level_sd_mm > 0.0 else ()),
            *rounds_notes(solved.stopped),
            *feedback_notes(lit.gain, lit.left_mm, float(solved.depth_mm.max())),
            *unsolved_notes(solved.unsolved_share, fits=not residual.findings),
            *small_image_notes(pitch_mm, decay_mm),
            *too_coarse_notes(lost_at_top(solved.depth_mm), noise_mm, solved.scale.pitch_mm),
        )

    def _noise(
        self,
        image: RawFrame,
        solved: SolvedRegion,
        residual: ContactLightResidual,
        request: SolveRequest,
        share_sd: float,
    ) -> DepthNoise:
        """Return the standard deviations of a solved region."""
        task = RegionTask(solved.region, solved.compared, MOVED)
        # Solving again overwrites the slopes' buffers.
        slopes = RegionSlopes(*(part.copy() for part in solved.slopes))  # type: ignore[arg-type]
        solved = solved._replace(slopes=slopes, weight=solved.weight.copy())

        def solve(ratio: Float32Array, start: tuple[Float32Array, Float32Array]) -> RegionSlopes:
            moved = task.compared.fine._replace(ratio=ratio)
            return self._slopes(task, MOVED.factor, moved, solved.start_mm, start)

        levels = self._sampler.levels(image.raw.dtype, image.linear)
        noise = image_noise(image.raw, levels, self.workers)
        light_sd = None if request.light is None else request.light.sd
        given = solved, self.maps, noise, solve, self.workers, residual
        return depth_noise(*given, light_sd=light_sd, share_sd=share_sd)

    def _left_out(self, record: TraceRecorder, factor: int) -> None:
        """Record what the scale and the membrane leave out."""
        if factor > 1:
            record.add_skipped(LAST_ROUND[1], "this effort does not use it")
        if factor == COARSE:
            record.add_skipped("denoising", "averages over 4 x 4 pixels have little noise")
        if self.maps.membrane.interreflection == 0.0:
            record.add_skipped("interreflection", "this membrane has none")
        if self.maps.membrane.gloss is None:
            record.add_skipped("gloss", "this membrane has none")


def _nothing_pressed(record: TraceRecorder) -> None:
    for name in (COMPARING, "near light", INTEGRATION):
        record.add_skipped(name, NOTHING_PRESSED)


def _enlarged(values: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Return a map at a finer scale."""
    if values.shape == shape:
        return values
    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_LINEAR))
