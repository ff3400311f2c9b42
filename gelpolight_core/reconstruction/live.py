"""The full model for live pictures: planned, in the region of the contact, at half scale.

What is left out, and by how much that may change the depth beside the same model on the whole
grid at its full scale, is said with each constant.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.reconstruction.contact import Contact, contact_finder
from gelpolight_core.reconstruction.full import (
    LET_GO,
    RIM_CHANGE,
    SATURATED,
    crossed_rim,
    held_back,
    longest_step_mm,
    near_light_rounds,
)
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.live_integration import integrate_live
from gelpolight_core.reconstruction.live_kernel import solve_rows
from gelpolight_core.reconstruction.live_maps import LiveMaps, LiveScale, light_levels, live_maps
from gelpolight_core.reconstruction.live_pixels import (
    halve,
    place_rows,
    sample_rows,
    show_depth,
    show_normals,
)
from gelpolight_core.reconstruction.plan import Plan, PlanStep
from gelpolight_core.reconstruction.poisson import good_length
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
# Of the integration: the first rounds only have to say where the surface is.
FIRST_TOLERANCE = 0.03
TOLERANCE = 3e-3


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of quarter-scale nodes: its first row and column, and its size."""

    corner: tuple[int, int]
    shape: tuple[int, int]

    def at(self, factor: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return corner and shape at a finer scale, `factor` nodes to a quarter-scale node."""
        (top, left), (rows, columns) = self.corner, self.shape
        return (factor * top, factor * left), (factor * rows, factor * columns)


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
    """

    depth_mm: Map
    normals: Map | None
    flags: NDArray[np.uint8]
    stopped: str
    rim: str
    plan: Plan


@dataclass(slots=True)
class _Record:
    """The steps of one frame as they happen."""

    steps: list[PlanStep] = field(default_factory=list)

    @contextmanager
    def done(self, name: str) -> Iterator[list[str]]:
        """Time a step; the caller appends its reason."""
        reason: list[str] = []
        begin = perf_counter()
        yield reason
        took = 1e3 * (perf_counter() - begin)
        self.steps.append(PlanStep(name, True, "; ".join(reason), took))

    def left_out(self, name: str, reason: str) -> None:
        self.steps.append(PlanStep(name, False, reason))


@dataclass(frozen=True, slots=True)
class _Solved:
    """Slopes along the rays of one scale's region."""

    slope_x: Map
    slope_y: Map
    weight: Map
    flags: NDArray[np.uint8]
    normal_x: Map
    normal_y: Map


@dataclass(frozen=True, slots=True)
class _Picture:
    """Press over background in a region of one scale."""

    ratio: Map
    saturated: NDArray[np.uint8]
    around: Map
    let_go: NDArray[np.bool_] | None


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
        inverse = np.linalg.inv(calibration.crosstalk).astype(np.float32)
        self._unmix = tuple(tuple(row) for row in inverse)
        self._light: dict[tuple[np.dtype[Any], bool], Map] = {}
        self._linear = False
        self._buffers: dict[str, NDArray[Any]] = {}
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
        record = _Record()
        depth = np.zeros(self.maps.flags.shape, np.float32)
        flags = self.maps.flags.copy()
        shown = flat_normals(depth.shape) if normals else None
        region, stopped, rim = self._region(raw, record, everywhere), "done", "held"
        if region is None:
            for name in (tr("resampling and comparing"), tr("near light"), tr("integration")):
                record.left_out(name, tr("nothing is pressed into the membrane"))
        else:
            stopped, rim = self._solve(raw, region, effort, record, depth, flags, shown)
        if not normals:
            record.left_out(tr("normals"), tr("nobody asked for them"))
        return LiveDepth(depth, shown, flags, stopped, rim, Plan(effort, tuple(record.steps)))

    def _region(self, raw: NDArray[Any], record: _Record, everywhere: bool) -> Region | None:
        whole = Region((0, 0), self.maps.quarter.shape)
        if everywhere:
            record.left_out(tr("looking for a contact"), tr("the whole field is wanted"))
            return whole
        with record.done(tr("looking for a contact")) as reason:
            contact = self.finder.find(raw, self._workers)
            if contact is None:
                reason.append(tr("the picture is the background's"))
                return None
            region = self._padded(contact)
            share = float(np.prod(region.shape)) / float(np.prod(whole.shape))
            reason.append(tr("{share:.0%} of the field is solved").format(share=share))
        return whole if share > WHOLE else region

    def _padded(self, contact: Contact) -> Region:
        """Return a contact's region with its margin, of lengths that the transform likes."""
        scale = self.maps.quarter
        spans = []
        for axis in (1, 0):
            first = (contact.low[axis] - self._margin_mm - scale.origin_mm[axis]) / scale.pitch_mm
            last = (contact.high[axis] + self._margin_mm - scale.origin_mm[axis]) / scale.pitch_mm
            spans.append(_span(first, last, scale.shape[1 - axis]))
        (top, rows), (left, columns) = spans
        return Region((top, left), (rows, columns))

    def _solve(
        self,
        raw: NDArray[Any],
        region: Region,
        effort: str,
        record: _Record,
        depth: Map,
        flags: NDArray[np.uint8],
        normals: Map | None,
    ) -> tuple[str, str]:
        """Solve a region and write it into the maps of the whole grid."""
        maps = self.maps
        with record.done(tr("resampling and comparing")) as reason:
            half, quarter = self._compare(raw, region)
            reason.append(tr("in blocks of 2 x 2 nodes, whose averages need no denoising"))
        if maps.membrane.bounce is None:
            record.left_out(tr("light from the surroundings"), tr("this membrane gives none"))
        corner, shape = region.at(1)
        with record.done(tr("near light, quarter scale")) as reason:
            said = near_light_rounds(
                lambda d: self._round(maps.quarter, quarter, corner, d, FIRST_TOLERANCE)[1],
                shape,
                longest_step_mm(self._full),
                ROUNDS,
                shallow_mm=SHALLOW_MM,
            )
            solved, (changes, stopped) = said
            reason.append(tr("{n} rounds").format(n=len(changes)))
        if len(changes) < ROUNDS:
            record.left_out(
                tr("second near-light round"),
                tr("the press is {d:.2f} mm deep").format(d=max(changes)),
            )
        scale = maps.half if effort == "balanced" else maps.quarter
        picture = half if effort == "balanced" else quarter
        corner, shape = region.at(4 // scale.factor)
        if effort == "balanced":
            start = cv2.resize(solved, shape[::-1], interpolation=cv2.INTER_LINEAR)
        else:
            record.left_out(tr("near light, half scale"), tr("this effort does without it"))
            start = solved
        name = tr("near light, half scale") if effort == "balanced" else tr("last round")
        with record.done(name) as reason:
            slopes, moved = self._round(scale, picture, corner, np.asarray(start))
            moved = held_back(np.asarray(start), moved, longest_step_mm(self._full))
        with record.done(tr("true positions")) as reason:
            self._show(scale, region, slopes, moved, depth, flags, normals)
        return stopped, "held" if picture.let_go is None else "free"

    def _compare(self, raw: NDArray[Any], region: Region) -> tuple[_Picture, _Picture]:
        """Return press over background at half and at quarter scale."""
        maps = self.maps
        corner, shape = region.at(2)
        small = region.shape
        ratio, coarse = self._take("ratio", (3, *shape)), self._take("coarse", (3, *small))
        marks = self._take("saturated", shape, np.uint8)
        coarse_marks = self._take("coarse saturated", small, np.uint8)
        limit = np.float32(SATURATED)
        self._workers.run(
            shape[0],
            sample_rows,
            raw,
            self._levels(raw.dtype, self._linear),
            limit,
            maps.u_px,
            maps.v_px,
            self._unmix,
            maps.gain,
            maps.half.kind,
            corner,
            ratio,
            marks,
        )
        halve(ratio, marks, coarse, coarse_marks)
        around = coarse_around = self._take("no surroundings", (3, 1, 1))
        let_go = None
        (top, left), kind = region.corner, maps.quarter.kind
        kind = kind[top : top + small[0], left : left + small[1]]
        if maps.membrane.bounce is not None or not kind.all() or self._at_border(region):
            coarse_around = self._around(coarse)
            let_go = self._released(coarse_around, kind)
        if maps.membrane.bounce is not None:
            around = self._take("around", (3, *shape))
            for k in range(3):
                cv2.resize(coarse_around[k], shape[::-1], around[k])
        large = None
        if let_go is not None:
            large = np.repeat(np.repeat(let_go, 2, axis=0), 2, axis=1)
        return (
            _Picture(ratio, marks, around, large),
            _Picture(coarse, coarse_marks, coarse_around, let_go),
        )

    def _at_border(self, region: Region) -> bool:
        """Return whether a region ends where the whole grid does."""
        pairs = zip(region.corner, region.shape, self.maps.quarter.shape, strict=True)
        return any(first == 0 or first + count == whole for first, count, whole in pairs)

    def _around(self, coarse: Map) -> Map:
        """Return press over background, averaged over the surroundings; as `neighbourhood`."""
        reach = self._full.membrane.bounce_reach_mm / self.maps.quarter.pitch_mm
        factor = max(int(reach / 4.0), 1)
        rows, columns = coarse.shape[1:]
        size = (max(columns // factor, 1), max(rows // factor, 1))
        result = self._take("coarse around", coarse.shape)
        for k in range(3):
            known = np.clip(coarse[k], 0.0, 4.0)
            small = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
            small = cv2.GaussianBlur(small, (0, 0), reach / factor)
            cv2.resize(small, (columns, rows), result[k])
        return result

    def _released(self, around: Map, kind: NDArray[np.uint8]) -> NDArray[np.bool_] | None:
        """Return where a contact crosses the rim, or None where it does not."""
        disturbed = np.abs(around - 1.0).max(axis=0) > RIM_CHANGE
        let_go = crossed_rim(kind > 0, disturbed, self.maps.quarter.pitch_mm)
        return let_go if let_go.any() else None

    def _round(
        self,
        scale: LiveScale,
        picture: _Picture,
        corner: tuple[int, int],
        depth: Map,
        tolerance: float = TOLERANCE,
    ) -> tuple[_Solved, Map]:
        """One near-light round; as `full._round`."""
        membrane, shape = self.maps.membrane, depth.shape
        solved = _Solved(
            self._take("slope x", shape),
            self._take("slope y", shape),
            self._take("weight", shape),
            self._take("flags", shape, np.uint8),
            self._take("normal x", shape),
            self._take("normal y", shape),
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
            solved.slope_x,
            solved.slope_y,
            solved.weight,
            solved.flags,
            solved.normal_x,
            solved.normal_y,
        )
        weight, hold = solved.weight, None
        if picture.let_go is not None:
            hold = np.where(picture.let_go, np.float32(LET_GO), np.float32(1.0))
            inside = scale.kind[corner[0] : corner[0] + shape[0], corner[1] : corner[1] + shape[1]]
            weight = np.where(inside > 0, weight, weight * hold)
        result = integrate_live(
            solved.slope_x,
            solved.slope_y,
            weight,
            pitch_mm=scale.pitch_mm,
            start_mm=depth,
            hold=hold,
            tolerance=tolerance,
            workers=self._workers.count,
        )
        return solved, result.depth_mm

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

    def _levels(self, dtype: np.dtype[Any], linear: bool) -> Map:
        kind = (dtype, linear)
        if kind not in self._light:
            response = None if linear else self.calibration.response
            self._light[kind] = light_levels(response, dtype)
        return self._light[kind]

    def _take(
        self, name: str, shape: tuple[int, ...], dtype: type[np.generic] = np.float32
    ) -> NDArray[Any]:
        """Return a work buffer; what it held before is of no use."""
        size = int(np.prod(shape))
        kept = self._buffers.get(name)
        if kept is None or kept.size < size:
            kept = self._buffers[name] = np.empty(size, dtype)
        return kept[:size].reshape(shape)


def flat_normals(shape: tuple[int, ...]) -> Map:
    """Return normals (rows, columns, 3) of the flat membrane."""
    normals = np.zeros((*shape, 3), np.float32)
    normals[..., 2] = -1.0
    return normals


def _span(first: float, last: float, length: int) -> tuple[int, int]:
    """Return begin and count of a span of nodes about `first` to `last`, of a good length."""
    begin, end = max(int(np.floor(first)), 0), min(int(np.ceil(last)) + 1, length)
    count = min(good_length(max(end - begin, 8)), length)
    return min(max((begin + end - count) // 2, 0), length - count), count


def _whole_numbers(frame: NDArray[Any]) -> NDArray[Any]:
    """Return a frame as whole numbers; what is not finite in floats counts as saturated."""
    if frame.dtype.kind != "f":
        return np.ascontiguousarray(frame)
    known = np.nan_to_num(frame, nan=1.0, posinf=1.0, neginf=1.0)
    return np.asarray(np.clip(known, 0.0, 1.0) * 65535.0 + 0.5, np.uint16)
