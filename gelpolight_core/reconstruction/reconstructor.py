"""From one picture to a height map, with nothing but a calibration."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.reconstruction.acceptance import (
    RimCheck,
    accepted,
    refuse_coplanar_lights,
    refuse_dark_membrane,
    rim_check,
    rim_let_go,
    unsolved_note,
)
from gelpolight_core.reconstruction.full import as_linear, reconstruct_full
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.reconstruction.live import LiveSolver
from gelpolight_core.reconstruction.live_maps import CURVE_ERROR
from gelpolight_core.reconstruction.normals import (
    ShadingMaps,
    SlopeField,
    SlopeSolver,
    normals_from_slopes,
)
from gelpolight_core.reconstruction.paper_kernel import blank_rows
from gelpolight_core.reconstruction.plan import EFFORTS, Plan, PlanStep
from gelpolight_core.reconstruction.poisson import PoissonSolver
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.translation import tr

Notes = tuple[str, ...]
LOOKUP_SIZE = 2048


class Reconstructor:
    """Reconstructs height maps; what does not change from frame to frame is made ready once.

    Parameters
    ----------
    calibration : Calibration
        Of the sensor that the pictures come from.
    model : str, optional
        ``paper`` or ``full``; by default the one that the calibration was made for.
    terms : Terms, optional
        What the full model reckons with; by default everything.
    effort : str, optional
        How much work the full model's frame is worth: ``best``, the whole grid at its full scale;
        ``balanced``, what the frame needs, at half scale, for live pictures; ``fast``, at quarter
        scale. The paper's model knows one way only.
    workers : int, optional
        Threads of the solve and the transforms.

    Raises
    ------
    InputError
        If the calibration was not made for the model, its lights lie nearly in one plane,
        or there is light on next to nothing of the membrane.
    ValueError
        If there is no such effort.

    Examples
    --------
    >>> Reconstructor(read_calibration(path)).depth(frame).depth_mm  # doctest: +SKIP
    """

    def __init__(
        self,
        calibration: Calibration,
        *,
        model: str | None = None,
        terms: Terms = ALL_TERMS,
        effort: str = "best",
        workers: int = 2,
    ) -> None:
        if effort not in EFFORTS:
            raise ValueError(f"effort = {effort!r}, expected one of {EFFORTS}")
        self.calibration = calibration
        self.model = model or calibration.model
        if self.model == "full" and calibration.full is None:
            raise InputError(
                tr("the calibration was made for the paper's model only"),
                where=calibration.identity,
                advice=tr("Calibrate again with --model full, or use --model paper"),
            )
        used = calibration.full if self.model == "full" else None
        leds_mm = calibration.led_positions_mm if used is None else used.led_positions_mm
        refuse_coplanar_lights(calibration, leds_mm)
        refuse_dark_membrane(calibration)
        self.terms = terms
        self.effort = effort
        self.workers = workers

    @cached_property
    def maps(self) -> ShadingMaps:
        """The calibration's maps as the paper's fused pass wants them."""
        return shading_maps(self.calibration)

    @cached_property
    def _threads(self) -> RowWorkers:
        return RowWorkers(self.workers)

    @cached_property
    def slope_solver(self) -> SlopeSolver:
        """The paper's fused pass on the calibration's maps."""
        return SlopeSolver(self.maps, self._threads)

    @cached_property
    def solver(self) -> PoissonSolver:
        """The paper's integration on the calibration's grid."""
        grid = self.calibration.table.grid
        return PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=self.workers)

    @cached_property
    def rim(self) -> RimCheck:
        """What the rim shows while nothing crosses it."""
        return rim_check(self.calibration)

    @cached_property
    def live(self) -> LiveSolver:
        """The planned solve of ``balanced`` and ``fast``."""
        assert self.calibration.full is not None
        return LiveSolver(self.calibration, self.calibration.full, workers=self.workers)

    def at_effort(self, effort: str) -> Reconstructor:
        """Return one of another effort, which shares what is made ready already.

        Raises
        ------
        ValueError
            If there is no such effort.
        """
        if effort not in EFFORTS:
            raise ValueError(f"effort = {effort!r}, expected one of {EFFORTS}")
        other = copy.copy(self)
        other.effort = effort
        return other

    def warm_up(self, dtype: DTypeLike = np.uint8) -> None:
        """Make ready all that the first frame would wait for: maps, compiled parts, buffers.

        The compiled parts are kept on disk; the very first time they take most of a minute.

        Parameters
        ----------
        dtype : dtype, optional
            Of the frames to come.
        """
        camera = self.calibration.camera
        self.depth(np.zeros((camera.height, camera.width, 3), dtype))

    def plan(self, frame: NDArray[Any], *, normals: bool = True, uncertainty: bool = False) -> Plan:
        """Return which steps a frame needs, and why the others are left out.

        Parameters
        ----------
        frame, normals, uncertainty
            As in :meth:`depth`, which is what finds out.
        """
        plan = self.depth(frame, normals=normals, uncertainty=uncertainty).plan
        assert plan is not None
        return plan

    def slopes(self, frame: NDArray[Any], *, name: str = "") -> SlopeField:
        """Return the depth's slopes of a raw frame (height, width, 3), RGB.

        Parameters
        ----------
        frame, name
            As in :meth:`depth`. The paper's model is used, whatever the reconstructor's is.

        Raises
        ------
        InputError
            If the frame is not of the calibration's size, not in colour, or holds other numbers
            than :meth:`depth` takes.
        """
        return self.slope_solver.solve(self.linearise(self._accepted(frame, name)))

    def linearise(self, frame: NDArray[Any]) -> NDArray[Any]:
        """Return a frame with the camera's response undone; floats are linear light already."""
        response = self.calibration.response
        return frame if response is None or frame.dtype.kind == "f" else response.linearise(frame)

    def depth(
        self,
        frame: NDArray[Any],
        *,
        name: str = "",
        normals: bool = True,
        uncertainty: bool = False,
    ) -> HeightMap:
        """Reconstruct a raw frame.

        Parameters
        ----------
        frame : (height, width, 3) uint8, uint16 or float32
            RGB; whole numbers as the camera encodes them, float frames linear light 0..1.
        name : str, optional
            The picture's name, kept in the result.
        normals : bool, optional
            Whether the result holds normals.
        uncertainty : bool, optional
            Whether the result holds how far each pixel may be off; several times as slow.
            The paper's model states none.

        Raises
        ------
        InputError
            If the frame is not of the calibration's size, or holds other numbers than these.
        """
        frame = self._accepted(frame, name)
        notes = self._rim_notes(frame)
        if self.model == "full":
            why = self._why_unplanned(uncertainty)
            if why is None:
                return self._depth_live(frame, name, normals, notes)
            return self._depth_full(frame, name, normals, uncertainty, why, notes)
        light = self.linearise(frame)
        divergence, field = self.slope_solver.divergence(light, self.solver, slopes=normals)
        depth_mm = self.solver.depth_of(divergence)
        self._threads.run(len(depth_mm), blank_rows, field.flags, depth_mm)
        shown = normals_from_slopes(field.slope_x, field.slope_y) if normals else None
        depth_mm = np.asarray(depth_mm, np.float32)
        heightmap = self._heightmap(depth_mm, shown, field.flags, name, notes)
        names = [tr("resampling, normals and their divergence"), tr("integration")]
        plan = _unplanned(self.effort, names, tr("the paper's model knows one way"), normals, False)
        return replace(heightmap, plan=plan)

    def _why_unplanned(self, uncertainty: bool) -> str | None:
        """Return why everything is done for a frame, or None where it is planned."""
        if self.effort == "best":
            return tr("the effort is best")
        if uncertainty:
            return tr("standard deviations are asked for")
        if self.terms != ALL_TERMS:
            return tr("terms of the model are left out by hand")
        if self.live.maps.membrane.curve_error > CURVE_ERROR:
            return tr("the membrane's curve is too bent for the fast solve")
        return None

    def _depth_live(self, frame: NDArray[Any], name: str, normals: bool, notes: Notes) -> HeightMap:
        full = self.calibration.full
        assert full is not None
        found = self.live.depth(frame, effort=self.effort, normals=normals)
        notes += _notes(found.rim, found.stopped, found.unsolved)
        heightmap = self._heightmap(found.depth_mm, found.normals, found.flags, name, notes)
        scale = full.scale_sd
        return replace(
            heightmap,
            depth_scale_sd=None if scale is None else scale.depth,
            lateral_scale_sd=None if scale is None else scale.lateral,
            plan=found.plan,
        )

    def _depth_full(
        self,
        frame: NDArray[Any],
        name: str,
        normals: bool,
        uncertainty: bool,
        why: str,
        notes: Notes,
    ) -> HeightMap:
        full = self.calibration.full
        assert full is not None
        result = reconstruct_full(
            as_linear(self.linearise(frame)),
            self.calibration,
            full,
            terms=self.terms,
            workers=self.workers,
            uncertainty=uncertainty,
        )
        notes += _notes(result.rim, result.stopped, result.unsolved)
        shown = result.normals if normals else None
        heightmap = self._heightmap(result.depth_mm, shown, result.flags, name, notes)
        scale, noise = full.scale_sd, result.noise
        return replace(
            heightmap,
            slope_sd=None if noise is None else noise.slope_sd,
            depth_sd_mm=None if noise is None else noise.depth_sd_mm,
            slope_model_sd=None if noise is None else noise.slope_model_sd,
            depth_model_sd_mm=None if noise is None else noise.depth_model_sd_mm,
            noise_mm=None if noise is None else noise.examples_mm,
            depth_scale_sd=None if scale is None else scale.depth,
            lateral_scale_sd=None if scale is None else scale.lateral,
            plan=_unplanned(self.effort, _full_names(), why, normals, uncertainty),
        )

    def _heightmap(
        self,
        depth_mm: NDArray[np.float32],
        normals: NDArray[np.float32] | None,
        flags: NDArray[np.uint8],
        name: str,
        notes: Notes,
    ) -> HeightMap:
        grid = self.calibration.table.grid
        return HeightMap(
            depth_mm=depth_mm,
            x_mm=grid.x_mm,
            y_mm=grid.y_mm,
            pitch_mm=grid.pitch_mm,
            normals=normals,
            flags=flags,
            calibration_id=self.calibration.identity,
            model=self.model,
            source=name,
            notes=notes,
        )

    def _rim_notes(self, frame: NDArray[Any]) -> Notes:
        rim = self.rim
        note = rim.note(as_linear(self.linearise(frame[rim.row, rim.column][None]))[0])
        return (note,) if note else ()

    def _accepted(self, frame: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a frame of the right size as numbers that every step takes."""
        camera = self.calibration.camera
        if frame.shape != (camera.height, camera.width, 3):
            shape = "x".join(str(n) for n in (*frame.shape[1::-1], *frame.shape[2:]))
            raise InputError(
                tr("the picture is {shape}, the calibration is for {w}x{h}x3").format(
                    shape=shape, w=camera.width, h=camera.height
                ),
                where=name or tr("picture"),
                advice=tr("Use the calibration of this sensor at this picture size"),
            )
        return accepted(frame, name=name)


def _notes(rim: str, stopped: str, unsolved: float) -> Notes:
    """Return what is to be said of a reconstruction, in sentences for a person."""
    notes = []
    if rim == "free":
        notes.append(rim_let_go())
    if stopped == "damped":
        notes.append(tr("the press is deep for its lights: the near-light rounds were damped"))
    if stopped == "unsettled":
        notes.append(tr("the near-light rounds did not settle: damping did not help"))
    if stopped == "grows":
        notes.append(tr("the near-light rounds did not settle: the last was taken back"))
    notes += [note for note in (unsolved_note(unsolved),) if note]
    return tuple(notes)


def _full_names() -> list[str]:
    return [
        tr("resampling and comparing"),
        tr("near light, quarter scale"),
        tr("near light, full scale"),
        tr("integration"),
        tr("true positions"),
    ]


def _unplanned(effort: str, names: list[str], why: str, normals: bool, uncertainty: bool) -> Plan:
    """Return the plan of a frame for which everything is done."""
    asked = {tr("normals"): normals, tr("standard deviations"): uncertainty}
    return Plan(
        effort,
        (
            *(
                PlanStep(name, True, tr("nothing is left out: {why}").format(why=why))
                for name in names
            ),
            *(
                PlanStep(name, wanted, tr("asked for") if wanted else tr("nobody asked for them"))
                for name, wanted in asked.items()
            ),
        ),
    )


def shading_maps(calibration: Calibration) -> ShadingMaps:
    """Gather a calibration's maps as the fused pass wants them."""
    table = calibration.table
    strength = calibration.radiance * calibration.factors
    usable = table.valid & (strength > 0.0).all(axis=2)
    gain = np.zeros_like(strength)
    gain[usable] = 1.0 / strength[usable]
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
