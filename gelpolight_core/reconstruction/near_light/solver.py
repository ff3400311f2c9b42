"""The near-light model: one solver for every scale and region.

The efforts `fast`, `balanced` and `best` are parameter sets of it (:mod:`.settings`). What a frame
does not need is left out; the bounds on what that may change are stated with each constant and held
by tests.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from threading import Lock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.arrays import Map
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.coded import coded
from gelpolight_core.light.contact import ContactLight
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.checks import (
    free_boundary_note,
    refuse_coplanar_lights,
    refuse_dark_membrane,
    rounds_notes,
    small_image_notes,
    too_coarse_notes,
    unanchored_note,
    unsolved_notes,
    visible_depth_notes,
)
from gelpolight_core.reconstruction.height_map import COARSE, Flag, HeightMap
from gelpolight_core.reconstruction.linear import linearised
from gelpolight_core.reconstruction.near_light.contact import (
    AREA_SIGMAS,
    margin_mm,
    padded_region,
)
from gelpolight_core.reconstruction.near_light.from_around import FromAround
from gelpolight_core.reconstruction.near_light.image_noise import image_noise
from gelpolight_core.reconstruction.near_light.maps import SensorMaps
from gelpolight_core.reconstruction.near_light.placement import (
    place_rows,
    show_depth,
    show_normals,
)
from gelpolight_core.reconstruction.near_light.ratio_sampler import Compared, Image, RatioSampler
from gelpolight_core.reconstruction.near_light.region_solver import (
    RegionSolver,
    Rounds,
    SolvedRegion,
    Start,
    unsolved_share,
)
from gelpolight_core.reconstruction.near_light.settings import MOVED, SETTINGS, Settings
from gelpolight_core.reconstruction.near_light.structures import Region, Slopes
from gelpolight_core.reconstruction.near_light.surface_image import surface_image
from gelpolight_core.reconstruction.near_light.uncertainty import depth_noise, no_contact_noise
from gelpolight_core.reconstruction.resolution import lost_at_top
from gelpolight_core.reconstruction.solver import (
    INTEGRATION,
    LOOKING,
    NOTHING_PRESSED,
    DepthNoise,
    OpenSolver,
    Solved,
    Wanted,
    unseen_reason,
)
from gelpolight_core.reconstruction.terms import Terms
from gelpolight_core.reconstruction.trace import EFFORTS, Trace, TraceRecorder, TraceStep
from gelpolight_core.sensor_calibration import OpenSensor
from gelpolight_core.stated_lengths import stated_sd

RESOLVED = 0.5
"""Widest node by the drape's decay length: with nodes of 0.57 a cylinder of 1 mm is 4 % low, with
0.28 2 %."""
WHOLE = 0.85
"""A region with this share of the grid is extended to all of it."""
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


class NearLightSolver(OpenSolver):
    """Reconstructs frames by the near-light model, doing for each what it needs.

    Work buffers are kept from frame to frame; results are always new. It may be called from
    several threads, which then wait for each other. Results do not depend on the number of
    worker threads.

    Parameters
    ----------
    calibration : OpenSensor
        The sensor's, with its full model.
    workers : int
        Threads.
    settings : mapping, optional
        What each effort spends on a frame.
    """

    def __init__(
        self,
        calibration: OpenSensor,
        *,
        workers: int,
        settings: Mapping[str, Settings] = SETTINGS,
    ) -> None:
        full = calibration.full
        assert full is not None
        self._settings = settings
        self.maps = SensorMaps(calibration, full)
        super().__init__(calibration, full.led_positions_mm, self.maps.usable, workers)
        buffers = Buffers()
        self._take = buffers.take
        self._sampler = RatioSampler(self.maps, self.workers, buffers)
        self._around = FromAround(self.maps, self.workers)
        self._solver = RegionSolver(self.maps, self.workers, buffers, self._around)
        self._lock = Lock()

    def with_settings(self, settings: Mapping[str, Settings]) -> NearLightSolver:
        """Return a solver with other settings, for studies; it shares all data and buffers."""
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
        if calibration.full is None:
            raise InputError(
                "the calibration was made for the paper's model only",
                calibration.serial,
                Remedy.OTHER_MODEL,
            )
        refuse_coplanar_lights(calibration, calibration.full.led_positions_mm)
        refuse_dark_membrane(calibration, calibration.full.background)

    def depth(self, frame: NDArray[Any], wanted: Wanted) -> Solved:
        """Reconstruct a frame; see :class:`Solver`."""
        wanted, record = self._begin(wanted)
        with self._lock:
            image = self._image(frame, wanted)
            region = self._region(image, record, wanted.everywhere)
            return self._depth(image, region, wanted, record)

    def needs(self, frame: NDArray[Any], wanted: Wanted) -> Trace:
        """Return which steps a frame needs, by looking for a contact only; see :class:`Solver`."""
        wanted, record = self._begin(wanted)
        factor = self._settings[wanted.effort].factor
        with self._lock:
            region = self._region(self._image(frame, wanted), record, wanted.everywhere)
        if region is None:
            _nothing_pressed(record)
        else:
            names = (COMPARING, COARSE_ROUNDS, LAST_ROUND[factor], INTEGRATION, PLACING)
            record.steps += [TraceStep(n, True, "a contact was found") for n in names]
            self._left_out(record, factor, wanted.terms)
        return Trace(wanted.effort, tuple(record.steps))

    def predict(self, height_map: HeightMap, *, step: int = 1) -> Map:
        """Return the image of a surface by the whole model; see :class:`Solver`."""
        return surface_image(height_map, self.maps, self._around, step)

    def effort_for(self, effort: str) -> str:
        """Return the effort, or the first finer one whose nodes resolve the membrane's drape."""
        pitch_mm, decay_mm = self.calibration.table.grid.pitch_mm, self.maps.full.decay_mm
        finer = EFFORTS[EFFORTS.index(effort) :]
        fits = (e for e in finer if self._settings[e].factor * pitch_mm <= RESOLVED * decay_mm)
        return next(fits, EFFORTS[-1])

    def _begin(self, wanted: Wanted) -> tuple[Wanted, TraceRecorder]:
        """Return what is done of what is wanted, and the record of the frame."""
        record = wanted.record()
        effort = wanted.effort
        used = EFFORTS[-1] if wanted.uncertainty else self.effort_for(effort)
        if used != effort and not wanted.uncertainty:
            pitch_mm = self._settings[effort].factor * self.calibration.table.grid.pitch_mm
            why = "the images are too small: nodes of {p:.2f} mm are wider than the drape"
            record.left_out(f"effort {effort}", why.format(p=pitch_mm))
        return replace(wanted, effort=used), record

    def _image(self, frame: NDArray[Any], wanted: Wanted) -> Image:
        """Return a frame in whole numbers."""
        if wanted.effort == EFFORTS[-1]:
            # Camera values and linear light use the same code, so that both give the same depth.
            frame = linearised(frame, self.calibration.response)
        return Image(*coded(frame), wanted.gain)

    def _depth(
        self, image: Image, region: Region | None, wanted: Wanted, record: TraceRecorder
    ) -> Solved:
        depth = np.zeros(self.maps.flags.shape, np.float32)
        flags = self.maps.flags.copy()
        shown = self.maps.normals_at_rest.copy() if wanted.normals else None
        noise, notes = None, list(self._condition_notes)
        if region is None:
            _nothing_pressed(record)
            noise = no_contact_noise(depth.shape) if wanted.uncertainty else None
            notes += visible_depth_notes(self.visible_mm)
        else:
            rounds, solved = self._solved(image, region, wanted, record)
            boundary = solved.boundary
            notes += [] if boundary.free is None else [free_boundary_note()]
            notes += [unanchored_note()] if boundary.level_sd_mm > 0.0 else []
            left = self._solver.left_over(solved)
            notes += rounds_notes(rounds.stopped)
            notes += unsolved_notes(unsolved_share(solved), fits=not left.findings)
            notes += left.findings
            notes += small_image_notes(
                self.calibration.table.grid.pitch_mm, self.maps.full.decay_mm
            )
            top, noise_mm = lost_at_top(solved.depth_mm), self.visible_mm / AREA_SIGMAS
            notes += too_coarse_notes(top, noise_mm, solved.scale.pitch_mm)
            with record.done(PLACING, depth.size * SHOWN_BYTES) as reason:
                self._show(solved, wanted.terms, depth, flags, shown)
                if boundary.level_sd_mm > 0.0:
                    flags[(flags & np.uint8(Flag.OUTSIDE)) == 0] |= np.uint8(Flag.UNANCHORED)
                reason.append("and to the scale of the whole grid")
            if wanted.uncertainty:
                with record.done("standard deviations", depth.nbytes) as reason:
                    noise = self._noise(image, solved, left, wanted)
                    reason.append("requested")
        if not wanted.normals:
            record.left_out("normals", "not requested")
        if not wanted.uncertainty:
            record.left_out("standard deviations", "not requested")
        scale, blur_px = self.maps.full.scale_sd, self.calibration.lens_blur_px
        stated = stated_sd(self.calibration.stack, None if scale is None else scale.shown)
        return Solved(
            depth,
            shown,
            flags,
            tuple(notes),
            Trace(wanted.effort, tuple(record.steps)),
            noise,
            depth_scale_sd=None if scale is None else math.hypot(scale.depth, stated.depth),
            lateral_scale_sd=None if scale is None else math.hypot(scale.lateral, stated.lateral),
            visible_depth_mm=None if wanted.everywhere else self.visible_mm,
            image_blur_mm=None
            if blur_px is None
            else blur_px * self.calibration.table.grid.pitch_mm,
        )

    def _noise(
        self, image: Image, solved: SolvedRegion, left: ContactLight, wanted: Wanted
    ) -> DepthNoise:
        """Return how far a solved region may be off."""
        compared, at = solved.compared.fine, (solved.scale, solved.region.at(COARSE)[0])
        # Solving again overwrites the slopes' buffers.
        slopes = Slopes(*(part.copy() for part in solved.slopes))  # type: ignore[arg-type]
        kept = solved._replace(slopes=slopes, weight=solved.weight.copy())

        def solve(ratio: Map, start: tuple[Map, Map]) -> Slopes:
            shaken = compared._replace(ratio=ratio)
            return self._solver.slopes(at, shaken, solved.start_mm, MOVED, wanted.terms, start)

        levels = self._sampler.levels(image.raw.dtype, image.linear)
        noise = image_noise(image.raw, levels, self.workers)
        light_sd = None if wanted.light is None else wanted.light.sd
        return depth_noise(kept, self.maps, noise, solve, self.workers, left, light_sd=light_sd)

    def _region(self, image: Image, record: TraceRecorder, everywhere: bool) -> Region | None:
        scale = self.maps.scale(COARSE)
        whole = Region((0, 0), scale.kind.shape)
        if everywhere:
            record.left_out(LOOKING, "the whole field is requested")
            return whole
        with record.done(LOOKING, image.raw.nbytes) as reason:
            contact = self.finder(image.linear).find(image.raw, self.workers, image.gain)
            if contact is None:
                reason.append(unseen_reason(self.visible_mm))
                return None
            region = padded_region(contact, scale, margin_mm(self.maps.full))
            share = region.nodes / whole.nodes
            reason.append(f"{share:.0%} of the field is solved")
        return whole if share > WHOLE else region

    def _solved(
        self, image: Image, region: Region, wanted: Wanted, record: TraceRecorder
    ) -> tuple[Rounds, SolvedRegion]:
        """Solve a region."""
        settings, terms = self._settings[wanted.effort], wanted.terms
        factor = settings.factor
        found, rounds, start = self._begun(image, region, wanted, record)
        if start.boundary.cut:
            record.left_out(
                LOOKING, "the contact extends beyond the region: the whole field is solved"
            )
            region = Region((0, 0), self.maps.scale(COARSE).kind.shape)
            found, rounds, start = self._begun(image, region, wanted, record)
        nodes, count = region.nodes * (COARSE // factor) ** 2, len(rounds.changes_mm)
        if count < terms.near_light_rounds:
            record.left_out("second near-light round", "the press is shallow")
        with record.done(LAST_ROUND[factor], nodes * SOLVED_BYTES) as reason:
            weighted = self._solver.last_slopes(region, found, start, settings, terms)
            reason.append("from the depth at quarter scale")
        with record.done(INTEGRATION, 5 * nodes * 4) as reason:
            solved = self._solver.last_depth(region, weighted, start.boundary, settings, terms)
            reason.append(f"conjugate gradients, rounds: {solved.integration_rounds}")
        self._left_out(record, factor, terms)
        if factor < COARSE and terms.denoising and found.edge is None:
            record.left_out("denoising", "the image has almost no noise")
        if start.boundary.free is None:
            record.left_out("free boundary", "no contact crosses the boundary")
        return rounds, solved

    def _begun(
        self, image: Image, region: Region, wanted: Wanted, record: TraceRecorder
    ) -> tuple[Compared, Rounds, Start]:
        """Compare a region with the background, and do the rounds at the coarsest scale."""
        settings, terms = self._settings[wanted.effort], wanted.terms
        factor = settings.factor
        nodes = region.nodes * (COARSE // factor) ** 2
        with record.done(COMPARING, nodes * SAMPLED_BYTES) as reason:
            found = self._sampler.compare(image, region, factor, terms)
            reason.append("crosstalk and camera response are corrected in the same step")
        size = terms.near_light_rounds * region.nodes * SOLVED_BYTES
        with record.done(COARSE_ROUNDS, size) as reason:
            rounds, start = self._solver.rounds(region, found, settings, terms)
            count, deepest = len(rounds.changes_mm), float(rounds.depth_mm.max())
            reason.append(f"rounds: {count}; {deepest:.2f} mm deep")
            if start.around is not None:
                reason.append(f"{settings.around_rounds} more with interreflection")
            if start.boundary.free is not None:
                reason.append("a contact crosses the boundary, which is free there")
        return found, rounds, start

    def _left_out(self, record: TraceRecorder, factor: int, terms: Terms) -> None:
        """Note what the scale, the membrane and the terms leave out."""
        if factor > 1:
            record.left_out(LAST_ROUND[1], "this effort does not use it")
        if not terms.denoising:
            record.left_out("denoising", "switched off")
        elif factor == COARSE:
            record.left_out("denoising", "averages over 4 x 4 pixels have little noise")
        if self.maps.membrane.interreflection == 0.0:
            record.left_out("interreflection", "this membrane has none")
        if self.maps.membrane.gloss is None:
            record.left_out("gloss", "this membrane has none")

    def _show(
        self,
        solved: SolvedRegion,
        terms: Terms,
        depth: Map,
        flags: NDArray[np.uint8],
        normals: Map | None,
    ) -> None:
        """Bring a region to true positions, and to the scale of the whole grid."""
        scale, slopes, position = solved.scale, solved.slopes, solved.position
        corner, shape = solved.region.at(COARSE // scale.factor)
        placed, marks = self._take("placed", shape), self._take("marks", shape, np.uint8)
        self.workers.run(
            shape[0],
            place_rows,
            solved.depth_mm,
            scale,
            corner,
            terms.true_positions,
            slopes.flags,
            int(Flag.NOT_OBSERVABLE),
            placed,
            marks,
            position,
        )
        if scale.rest is not None:
            rest = scale.rest[0, corner[0] : corner[0] + shape[0], corner[1] : corner[1] + shape[1]]
            # Depth along z at a place is not that along the ray that sees it.
            placed += rest - cv2.remap(rest, position[0], position[1], cv2.INTER_LINEAR)
        at, whole = solved.region.at(COARSE)
        outside, factor = int(Flag.OUTSIDE), scale.factor
        kind = self.maps.kind
        rows = (placed, marks, factor, at, outside, kind, depth, flags)
        self.workers.run(whole[0], show_depth, *rows)
        if normals is not None:
            x, y = slopes.normal_x, slopes.normal_y
            self.workers.run(whole[0], show_normals, x, y, position, factor, at, normals)


def _nothing_pressed(record: TraceRecorder) -> None:
    for name in (COMPARING, "near light", INTEGRATION):
        record.left_out(name, NOTHING_PRESSED)
