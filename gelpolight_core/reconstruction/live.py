"""The full model for live pictures: planned, in the region of the contact, at half scale.

What is left out, and by how much that may change the depth beside the same model on the whole
grid at its full scale, is said with each constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, repeat
from threading import Lock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.contact import contact_finder
from gelpolight_core.reconstruction.full import (
    LET_GO,
    held_back,
    longest_step_mm,
    near_light_rounds,
)
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.live_integration import LiveIntegration, integrate_live
from gelpolight_core.reconstruction.live_kernel import solve_rows
from gelpolight_core.reconstruction.live_maps import LiveMaps, LiveScale, live_maps
from gelpolight_core.reconstruction.live_picture import PressPicture, PressSampler
from gelpolight_core.reconstruction.live_pixels import (
    place_rows,
    show_depth,
    show_normals,
)
from gelpolight_core.reconstruction.near_light_kernel import UNSOLVED_WEIGHT
from gelpolight_core.reconstruction.plan import Plan, PlanRecord
from gelpolight_core.reconstruction.region import Region, padded_region
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
# The drape about a contact falls by a factor e over its decay length.
MARGIN_DECAYS = 1.5
LEAST_MARGIN_MM = 0.8
# A region of this share of the grid is taken as all of it.
WHOLE = 0.85
ROUNDS = 2
# A second round moves the surface by about twice its depth squared over the lights' height; below
# this depth, by less than half a micrometre.
SHALLOW_MM = 0.05
# Of the integration, round by round: the first ones only have to say where the surface is.
FIRST_TOLERANCES = (0.05, 0.005)
TOLERANCE = 1e-3
# Along both axes, of the nodes that are counted.
THIN = 2
# Bytes that a node at quarter scale, a solved node and a shown node must read and write once.
SAMPLED_BYTES, SOLVED_BYTES, SHOWN_BYTES = 4 * (12 + 20 + 13), 88, 6


@dataclass(frozen=True, slots=True)
class LiveDepth:
    """A planned reconstruction.

    Attributes
    ----------
    depth_mm, normals, flags
        As in :class:`FullDepth`; `normals` None where they were not asked for.
    stopped, rim : str
        As in :class:`FullDepth`.
    plan : Plan
        What was done and what was left out.
    unsolved : float
        As in :class:`FullDepth`.
    """

    depth_mm: Map
    normals: Map | None
    flags: NDArray[np.uint8]
    stopped: str
    rim: str
    plan: Plan
    unsolved: float = 0.0


@dataclass(frozen=True, slots=True)
class _Solved:
    """Slopes along the rays of one scale's region."""

    slope_x: Map
    slope_y: Map
    weight: Map
    flags: NDArray[np.uint8]
    normal_x: Map
    normal_y: Map


class LiveSolver:
    """Reconstructs frames by the full model, doing for each what it needs.

    Work buffers are kept from frame to frame; results are always new. It may be called from
    several threads, which then wait for each other.

    Parameters
    ----------
    calibration, full
        The sensor's.
    workers : int
        Threads.
    """

    def __init__(self, calibration: Calibration, full: FullModel, *, workers: int) -> None:
        self.calibration = calibration
        self.maps: LiveMaps = live_maps(calibration, full)
        self.finder = contact_finder(calibration, full)
        self._full = full
        self._workers = RowWorkers(workers)
        self._margin_mm = max(MARGIN_DECAYS * full.decay_mm, LEAST_MARGIN_MM)
        self._linear = False
        buffers = Buffers()
        self._take = buffers.take
        self._sampler = PressSampler(calibration, full, self.maps, self._workers, buffers)
        self._lock = Lock()

    def depth(
        self, frame: NDArray[Any], *, effort: str, normals: bool, everywhere: bool = False
    ) -> LiveDepth:
        """Reconstruct a raw frame (height, width, 3), uint8, uint16 or float.

        Parameters
        ----------
        frame
            RGB, as the camera encodes it; floats linear light 0..1.
        effort : str
            ``balanced`` or ``fast``.
        normals : bool
            Whether they are wanted.
        everywhere : bool, optional
            Whether to solve the whole grid without looking for a contact.
        """
        # A float picture is linear already, the background of a bent camera is not.
        linear = frame.dtype.kind == "f"
        everywhere = everywhere or (linear and self.calibration.response is not None)
        with self._lock:
            self._linear = linear
            return self._depth(_whole_numbers(frame), effort, normals, everywhere)

    def _depth(self, raw: NDArray[Any], effort: str, normals: bool, everywhere: bool) -> LiveDepth:
        record = PlanRecord()
        depth = np.zeros(self.maps.flags.shape, np.float32)
        flags = self.maps.flags.copy()
        shown = flat_normals(depth.shape) if normals else None
        region, stopped, rim = self._region(raw, record, everywhere), "done", "held"
        unsolved = 0.0
        if region is None:
            for name in (tr("resampling and comparing"), tr("near light"), tr("integration")):
                record.left_out(name, tr("nothing is pressed into the membrane"))
        else:
            stopped, rim, unsolved = self._solve(raw, region, effort, record, depth, flags, shown)
        if not normals:
            record.left_out(tr("normals"), tr("nobody asked for them"))
        record.left_out(tr("standard deviations"), tr("nobody asked for them"))
        plan = Plan(effort, tuple(record.steps))
        return LiveDepth(depth, shown, flags, stopped, rim, plan, unsolved)

    def _region(self, raw: NDArray[Any], record: PlanRecord, everywhere: bool) -> Region | None:
        whole = Region((0, 0), self.maps.quarter.shape)
        if everywhere:
            record.left_out(tr("looking for a contact"), tr("the whole field is wanted"))
            return whole
        with record.done(tr("looking for a contact"), raw.nbytes) as reason:
            contact = self.finder.find(raw, self._workers)
            if contact is None:
                reason.append(tr("the picture is the background's"))
                return None
            region = padded_region(contact, self.maps.quarter, self._margin_mm)
            share = region.nodes / whole.nodes
            reason.append(tr("{share:.0%} of the field is solved").format(share=share))
        return whole if share > WHOLE else region

    def _solve(
        self,
        raw: NDArray[Any],
        region: Region,
        effort: str,
        record: PlanRecord,
        depth: Map,
        flags: NDArray[np.uint8],
        normals: Map | None,
    ) -> tuple[str, str, float]:
        """Solve a region and write it into the maps of the whole grid.

        Returns how the rounds ended, what became of the rim, and the unsolved share.
        """
        maps, nodes = self.maps, region.nodes
        with record.done(tr("resampling and comparing"), nodes * SAMPLED_BYTES) as reason:
            half, quarter = self._sampler.compare(raw, region, linear=self._linear)
            reason.append(tr("averages over 2 x 2 nodes, crosstalk and response undone on the way"))
        record.left_out(tr("denoising"), tr("such an average has half the noise already"))
        if maps.membrane.bounce is None:
            record.left_out(tr("light from the surroundings"), tr("this membrane gives none"))
        with record.done(tr("near light, quarter scale"), ROUNDS * nodes * SOLVED_BYTES) as reason:
            start, normals_at, (changes, stopped) = self._rounds(region, quarter)
            reason.append(tr("rounds: {n}; {d:.2f} mm deep").format(n=len(changes), d=start.max()))
        if len(changes) < ROUNDS:
            record.left_out(tr("second near-light round"), tr("the press is that shallow"))
        scale, picture = (maps.half, half) if effort == "balanced" else (maps.quarter, quarter)
        corner, shape = region.at(4 // scale.factor)
        start, *first = (_enlarged(values, shape) for values in (start, *normals_at))
        if effort != "balanced":
            record.left_out(tr("near light, half scale"), tr("this effort does without it"))
        size = shape[0] * shape[1] * SOLVED_BYTES
        with record.done(tr("near light, last round"), size) as reason:
            slopes = self._slopes(scale, picture, corner, start, (first[0], first[1]))
            reason.append(tr("from the depth at quarter scale"))
        with record.done(tr("integration"), 5 * start.nbytes) as reason:
            solved = self._integrate(scale, picture, corner, start, slopes, TOLERANCE)
            moved = held_back(start, solved.depth_mm, longest_step_mm(self._full))
            reason.append(tr("conjugate gradients, rounds: {n}").format(n=solved.rounds))
        if picture.let_go is None:
            record.left_out(tr("free rim"), tr("no contact crosses the rim"))
        with record.done(tr("true positions"), 16 * nodes * SHOWN_BYTES) as reason:
            self._show(scale, region, slopes, moved, depth, flags, normals)
            reason.append(tr("and to the whole grid's scale"))
        rim = "held" if picture.let_go is None else "free"
        return stopped, rim, self._unsolved_share(scale, corner, slopes.weight)

    def _unsolved_share(self, scale: LiveScale, corner: tuple[int, int], weight: Map) -> float:
        """Return the share of the field's nodes that light does not decide, from some of them."""
        (top, left), (rows, columns) = corner, weight.shape
        usable = scale.kind[top : top + rows : THIN, left : left + columns : THIN] == 2
        unsolved = usable & (weight[::THIN, ::THIN] <= np.float32(UNSOLVED_WEIGHT))
        return THIN**2 * float(np.count_nonzero(unsolved)) / max(scale.usable_nodes, 1)

    def _rounds(
        self, region: Region, picture: PressPicture
    ) -> tuple[Map, tuple[Map, Map], tuple[tuple[float, ...], str]]:
        """Return depth and normals after the rounds at quarter scale; as `coarse_depth`."""
        scale, corner = self.maps.quarter, region.corner
        tolerances = chain(FIRST_TOLERANCES, repeat(FIRST_TOLERANCES[-1]))
        normals: tuple[Map, Map] | None = None

        def solve(depth: Map) -> Map:
            nonlocal normals
            slopes = self._slopes(scale, picture, corner, depth, normals)
            normals = slopes.normal_x, slopes.normal_y
            return self._integrate(scale, picture, corner, depth, slopes, next(tolerances)).depth_mm

        longest = longest_step_mm(self._full)
        depth, changes = near_light_rounds(
            solve, region.shape, longest, ROUNDS, shallow_mm=SHALLOW_MM
        )
        assert normals is not None
        return depth, normals, changes

    def _slopes(
        self,
        scale: LiveScale,
        picture: PressPicture,
        corner: tuple[int, int],
        depth: Map,
        start: tuple[Map, Map] | None,
    ) -> _Solved:
        """Return slopes along the rays at the present depth; as `solve_near_light`.

        Normals (x and y) to start from, where there are any, are overwritten.
        """
        membrane, shape = self.maps.membrane, depth.shape
        normal_x, normal_y = start or (self._take("normal x", shape), self._take("normal y", shape))
        solved = _Solved(
            self._take("slope x", shape),
            self._take("slope y", shape),
            self._take("weight", shape),
            self._take("flags", shape, np.uint8),
            normal_x,
            normal_y,
        )
        self._workers.run(
            shape[0],
            solve_rows,
            picture.ratio,
            picture.around,
            picture.saturated,
            np.ascontiguousarray(depth),
            scale.static,
            scale.kind,
            corner,
            scale.origin_mm,
            scale.pitch_mm,
            membrane.leds,
            membrane.dark,
            membrane.curves,
            membrane.gloss,
            membrane.bounce,
            True,
            start is not None,
            solved.slope_x,
            solved.slope_y,
            solved.weight,
            solved.flags,
            solved.normal_x,
            solved.normal_y,
        )
        return solved

    def _integrate(
        self,
        scale: LiveScale,
        picture: PressPicture,
        corner: tuple[int, int],
        depth: Map,
        slopes: _Solved,
        tolerance: float,
    ) -> LiveIntegration:
        """Integrate slopes from the present depth, the rim let go where a contact crosses it."""
        weight, hold = slopes.weight, None
        if picture.let_go is not None:
            (top, left), (rows, columns) = corner, depth.shape
            hold = np.where(picture.let_go, np.float32(LET_GO), np.float32(1.0))
            inside = scale.kind[top : top + rows, left : left + columns] > 0
            weight = np.where(inside, weight, weight * hold)
        return integrate_live(
            slopes.slope_x,
            slopes.slope_y,
            weight,
            pitch_mm=scale.pitch_mm,
            start_mm=depth if depth.any() else None,
            hold=hold,
            tolerance=tolerance,
            workers=self._workers,
        )

    def _show(
        self,
        scale: LiveScale,
        region: Region,
        slopes: _Solved,
        moved: Map,
        depth: Map,
        flags: NDArray[np.uint8],
        normals: Map | None,
    ) -> None:
        """Bring a region to true positions, and to the whole grid's scale."""
        corner, shape = region.at(4 // scale.factor)
        placed, marks = self._take("placed", shape), self._take("marks", shape, np.uint8)
        place = self._take("place", (2, *shape))
        self._workers.run(
            shape[0],
            place_rows,
            moved,
            scale.static,
            corner,
            np.float32(1.0 / scale.pitch_mm),
            slopes.flags,
            int(Flag.NOT_OBSERVABLE),
            placed,
            marks,
            place,
        )
        top_left, whole = region.at(4)
        outside = int(Flag.OUTSIDE)
        self._workers.run(
            whole[0], show_depth, placed, marks, scale.factor, top_left, outside, depth, flags
        )
        if normals is not None:
            self._workers.run(
                whole[0],
                show_normals,
                slopes.normal_x,
                slopes.normal_y,
                place,
                scale.factor,
                top_left,
                normals,
            )


def _enlarged(values: Map, shape: tuple[int, int]) -> Map:
    """Return a map at a finer scale."""
    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_LINEAR))


def flat_normals(shape: tuple[int, ...]) -> Map:
    """Return normals (rows, columns, 3) of the flat membrane."""
    normals = np.zeros((*shape, 3), np.float32)
    normals[..., 2] = -1.0
    return normals


def _whole_numbers(frame: NDArray[Any]) -> NDArray[Any]:
    """Return a frame as whole numbers; what is not finite in floats counts as saturated."""
    if frame.dtype.kind != "f":
        # Compiled code is made anew for an array that must not be written to.
        return np.require(frame, requirements=["C", "W"])
    known = np.nan_to_num(frame, nan=1.0, posinf=1.0, neginf=1.0)
    return np.asarray(np.clip(known, 0.0, 1.0) * 65535.0 + 0.5, np.uint16)
