"""Reconstruct a height map from one image and a calibration."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.health.check import HealthCheck
from gelpolight_core.health.finding import KEYS, Health, LightGain
from gelpolight_core.reconstruction.checks import (
    Note,
    Notes,
    accepted,
    condition_notes,
    free_boundary_note,
    refuse_coplanar_lights,
    refuse_dark_membrane,
    small_image_notes,
    unanchored_note,
    unsolved_notes,
    visible_depth_notes,
)
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.reconstruction.in_place.calibration import (
    AnyCalibration,
    InPlaceCalibration,
    require_open,
)
from gelpolight_core.reconstruction.in_place.solver import STEPS as IN_PLACE_STEPS
from gelpolight_core.reconstruction.in_place.solver import InPlaceSolver
from gelpolight_core.reconstruction.linear import linearised
from gelpolight_core.reconstruction.near_light.solver import NearLightDepth, NearLightSolver
from gelpolight_core.reconstruction.paper.depth import PAPER_REASON, PAPER_STEPS, PaperSolver
from gelpolight_core.reconstruction.paper.model import SlopeField
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.reconstruction.trace import EFFORTS, Trace, TraceStep
from gelpolight_core.sensor_calibration import MODELS, Calibration
from gelpolight_core.stated_lengths import stated_sd
from gelpolight_core.translation import tr

LIGHT = tr("light of the image")
STATED_CHANGE = 0.01
"""Change of a closed sensor's light that is stated: its images scatter by less."""


class Reconstructor:
    """Reconstructs height maps; what does not change from frame to frame is prepared once.

    Parameters
    ----------
    calibration : Calibration or InPlaceCalibration
        Of the sensor that the images come from.
    model : str, optional
        ``paper``, ``full`` or ``in-place``; by default the one that the calibration was made for.
    terms : Terms, optional
        What the full model includes; by default everything.
    effort : str, optional
        Scale at which the full model solves the region of the contact: ``best``, full scale;
        ``balanced``, half scale, for live images; ``fast``, quarter scale. The paper's model has
        one mode.
    workers : int, optional
        Threads. Results do not depend on their number.

    Raises
    ------
    InputError
        If the calibration was not made for the model, its lights lie nearly in one plane,
        or almost no part of the membrane has light.
    ValueError
        If there is no such effort.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"), effort="balanced")
    >>> image = gp.read_image("session/presses/cylinder_s5_d100.png")
    >>> height_map = sensor.depth(image)
    >>> round(float(height_map.depth_mm.max()))  # mm
    1
    """

    def __init__(
        self,
        calibration: AnyCalibration,
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
        if self.model not in (*MODELS, IN_PLACE):
            raise ValueError(f"model = {model!r}, expected one of {(*MODELS, IN_PLACE)}")
        self.terms = terms
        self.effort = effort
        self.workers = workers
        if isinstance(calibration, InPlaceCalibration) or self.model == IN_PLACE:
            _refuse_other_model(calibration, self.model)
            return
        if self.model == "full" and calibration.full is None:
            raise InputError(
                tr("the calibration was made for the paper's model only"),
                where=calibration.identity,
                advice=tr("Calibrate again with --model full, or use --model paper"),
            )
        used = calibration.full if self.model == "full" else None
        leds_mm = calibration.led_positions_mm if used is None else used.led_positions_mm
        refuse_coplanar_lights(calibration, leds_mm)
        refuse_dark_membrane(calibration, model=self.model)
        self._notes = condition_notes(calibration, leds_mm)

    @property
    def _open(self) -> Calibration:
        """The calibration with optics and lights."""
        return require_open(self.calibration, where=self.calibration.identity)

    @cached_property
    def paper(self) -> PaperSolver:
        """The solver of the paper's model."""
        return PaperSolver(self._open, workers=self.workers)

    @cached_property
    def health_check(self) -> HealthCheck:
        """The comparison of frames with the background of the calibration."""
        return HealthCheck(self._open)

    @cached_property
    def near_light(self) -> NearLightSolver:
        """The solver of the full model."""
        assert self._open.full is not None
        return NearLightSolver(self._open, self._open.full, workers=self.workers)

    @cached_property
    def in_place(self) -> InPlaceSolver:
        """The solver of a closed sensor."""
        calibration = self.calibration
        assert isinstance(calibration, InPlaceCalibration)
        return InPlaceSolver(calibration.in_place, noise=calibration.noise, workers=self.workers)

    @property
    def visible_depth_mm(self) -> float | None:
        """Smallest depth of a pressed flat face that shows above the noise; None: not known.

        Shallower relief reads 0 by the full model. It follows from the calibration's noise, the
        pitch, the directions of the lights and the drape. The paper's model does not look for
        contacts.
        """
        return self.near_light.visible_mm if self.model == "full" else None

    def at_effort(self, effort: str) -> Reconstructor:
        """Return a reconstructor of another effort that shares all prepared data.

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
        """Prepare everything that the first frame needs: maps, compiled parts, buffers.

        The compiled parts are stored on disk; their first compilation takes almost a minute.

        Parameters
        ----------
        dtype : dtype, optional
            Of the frames to come.
        """
        camera = self.calibration.camera
        self.depth(np.zeros((camera.height, camera.width, 3), dtype))

    def needs(self, frame: NDArray[Any], *, name: str = "") -> Trace:
        """Return which steps a frame needs, without reconstructing it.

        It takes only the time of the health check and of the contact detection. The ``trace`` of a
        result contains the steps that were done, with times.

        Parameters
        ----------
        frame, name
            As in :meth:`depth`.

        Raises
        ------
        InputError
            As in :meth:`depth`.
        """
        frame = self._accepted(frame, name)
        if self.model == IN_PLACE:
            why = tr("calibration in place has one mode")
            return Trace(self.effort, tuple(TraceStep(s, True, why) for s in IN_PLACE_STEPS))
        light = self.health_check.check(frame).light
        if self.model == "full":
            found = self.near_light.needs(frame, effort=self.effort, terms=self.terms, light=light)
        else:
            steps = tuple(TraceStep(step, True, PAPER_REASON) for step in PAPER_STEPS)
            found = Trace(self.effort, steps)
        return replace(found, steps=(_light_step(light), *found.steps))

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
        frame = self._accepted(frame, name)
        light = self.health_check.check(frame).light
        return self.paper.slopes(frame, None if light is None else light.share)

    def linearise(self, frame: NDArray[Any]) -> NDArray[Any]:
        """Return a frame with the camera's response corrected; floats are linear light already."""
        return linearised(frame, self.calibration.response)

    def depth(
        self,
        frame: NDArray[Any],
        *,
        name: str = "",
        normals: bool = True,
        uncertainty: bool = False,
        health: Health | None = None,
    ) -> HeightMap:
        """Reconstruct a raw frame.

        Parameters
        ----------
        frame : (height, width, 3) uint8, uint16 or float
            RGB; whole numbers as the camera encodes them, float frames linear light 0..1.
        name : str, optional
            The image's name, kept in the result.
        normals : bool, optional
            Whether the result contains normals.
        uncertainty : bool, optional
            Whether the result contains standard deviations of each pixel; takes several times as
            long. The paper's model has none.
        health : Health, optional
            Of this frame, where it is known; by default the quick check for live images is made.

        Raises
        ------
        InputError
            If the frame has another size than the calibration, or another number type than these.
        """
        frame = self._accepted(frame, name)
        if self.model == IN_PLACE:
            return self._in_place_depth(frame, name, normals, uncertainty)
        health = self.health_check.check(frame) if health is None else health
        if self.model == "full":
            found = self._near_light_depth(frame, name, normals, uncertainty, health.light)
        else:
            found = self._paper_depth(frame, name, normals, health.light)
        assert found.trace is not None
        light = _light_step(health.light)
        return replace(
            found,
            health=health,
            notes=(*(finding.line for finding in health.findings), *found.notes),
            faults=(*found.faults, *(finding.cause for finding in health.faults)),
            trace=replace(found.trace, steps=(light, *found.trace.steps)),
        )

    def health(self, frame: NDArray[Any], *, name: str = "") -> Health:
        """Return the faults of a frame, each with cause and remedy.

        The whole image is searched for bad pixels, and large movements of the camera are followed.
        For a closed sensor everything is unknown.

        Parameters
        ----------
        frame, name
            As in :meth:`depth`.

        Raises
        ------
        InputError
            As in :meth:`depth`.
        """
        frame = self._accepted(frame, name)
        if self.model == IN_PLACE:
            return Health(unknown=KEYS)
        return self.health_check.check(frame, whole=True)

    def _paper_depth(
        self,
        frame: NDArray[Any],
        name: str,
        normals: bool,
        light: LightGain | None,
    ) -> HeightMap:
        gain = None if light is None else light.share
        found = self.paper.depth(frame, normals=normals, gain=gain)
        notes = (*self._notes, *found.notes)
        heightmap = self._heightmap(found.depth_mm, found.normals, found.flags, name, notes)
        return replace(
            heightmap,
            lateral_per_mm=self.paper.ray_spread_per_mm,
            trace=Trace(self.effort, found.steps),
        )

    def _near_light_depth(
        self,
        frame: NDArray[Any],
        name: str,
        normals: bool,
        uncertainty: bool,
        light: LightGain | None,
    ) -> HeightMap:
        full = self._open.full
        assert full is not None
        # Small images need a finer scale; standard deviations are those of effort best.
        effort = "best" if uncertainty else self.near_light.effort_for(self.effort)
        if effort == "best":
            # Camera values and linear light use the same code, so that both give the same depth.
            frame = self.linearise(frame)
        found = self.near_light.depth(
            frame,
            effort="best" if uncertainty else self.effort,
            terms=self.terms,
            normals=normals,
            uncertainty=uncertainty,
            light=light,
        )
        pitch_mm = self.calibration.table.grid.pitch_mm
        small = small_image_notes(pitch_mm, full.decay_mm) if found.rounds is not None else ()
        notes = (*self._notes, *_notes(found), *small)
        heightmap = self._heightmap(found.depth_mm, found.normals, found.flags, name, notes)
        scale, noise, stated = full.scale_sd, found.noise, stated_sd(self._open.stack)
        return replace(
            heightmap,
            slope_sd=None if noise is None else noise.slope_sd,
            depth_sd_mm=None if noise is None else noise.depth_sd_mm,
            slope_model_sd=None if noise is None else noise.slope_model_sd,
            depth_model_sd_mm=None if noise is None else noise.depth_model_sd_mm,
            noise_mm=None if noise is None else noise.examples_mm,
            depth_scale_sd=None if scale is None else math.hypot(scale.depth, stated.depth),
            lateral_scale_sd=None if scale is None else math.hypot(scale.lateral, stated.lateral),
            visible_depth_mm=self.visible_depth_mm,
            trace=found.trace,
        )

    def _in_place_depth(
        self, frame: NDArray[Any], name: str, normals: bool, uncertainty: bool
    ) -> HeightMap:
        calibration = self.calibration
        assert isinstance(calibration, InPlaceCalibration)
        model = calibration.in_place
        found = self.in_place.depth(
            self.linearise(frame),
            effort=self.effort,
            with_normals=normals,
            uncertainty=uncertainty,
        )
        light = _corrected_light(found.gain)
        changed = np.abs(found.gain - 1.0).max() > STATED_CHANGE
        notes = (*((Note(light.reason, doubtful=False),) if changed else ()), *found.notes)
        heightmap = self._heightmap(found.depth_mm, found.normals, found.flags, name, notes)
        return replace(
            heightmap,
            slope_sd=found.slope_sd,
            depth_sd_mm=found.depth_sd_mm,
            slope_model_sd=found.slope_model_sd,
            depth_model_sd_mm=found.depth_model_sd_mm,
            noise_mm=found.noise_mm,
            # A slope is a ratio of two lengths of the ball; a height is a slope times a length.
            depth_scale_sd=float(np.hypot(model.errors.depth_share, 2.0 * model.scale_sd)),
            lateral_scale_sd=model.scale_sd,
            trace=replace(found.trace, steps=(light, *found.trace.steps)),
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
            notes=tuple(note.text for note in notes),
            faults=(
                *filter(None, (self.calibration.fault,)),
                *(note.text for note in notes if note.doubtful),
            ),
        )

    def _accepted(self, frame: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a frame of the correct size in the number type of all steps."""
        camera = self.calibration.camera
        if frame.shape != (camera.height, camera.width, 3):
            shape = "x".join(str(n) for n in (*frame.shape[1::-1], *frame.shape[2:]))
            raise InputError(
                tr("the image is {shape}, the calibration is for {w}x{h}x3").format(
                    shape=shape, w=camera.width, h=camera.height
                ),
                where=name or tr("image"),
                advice=tr("Use the calibration of this sensor at this image size"),
            )
        frame = accepted(frame, name=name)
        if isinstance(self.calibration, InPlaceCalibration):
            return frame
        return self.calibration.bad_pixels.left_out(frame)


def _refuse_other_model(calibration: AnyCalibration, model: str) -> None:
    """Refuse a closed sensor's calibration for another model, and the reverse."""
    if model == calibration.model:
        return
    raise InputError(
        tr("the calibration was made for the model {made}, not for {model}").format(
            made=calibration.model, model=model
        ),
        where=calibration.identity,
        advice=tr("Leave --model out, or use a calibration for that model"),
    )


def _notes(found: NearLightDepth) -> Notes:
    """Return the notes on a reconstruction for the user, in sentences."""
    stopped = "" if found.rounds is None else found.rounds.stopped
    note_of = {
        "damped": Note(
            tr("the press is deep for its lights: the near-light rounds were damped"),
            doubtful=False,
        ),
        "unsettled": Note(tr("the near-light rounds did not converge: damping did not help")),
        "grows": Note(tr("the near-light rounds did not converge: the last round was undone")),
    }
    notes = [] if found.boundary.free is None else [free_boundary_note()]
    notes += [unanchored_note()] if found.boundary.level_sd_mm > 0.0 else []
    notes += [note_of[stopped]] if stopped in note_of else []
    hidden = visible_depth_notes(found.visible_mm) if found.rounds is None else ()
    return (*notes, *unsolved_notes(found.unsolved), *hidden)


def _light_step(light: LightGain | None) -> TraceStep:
    """Return the trace step about the light of a frame."""
    if light is None:
        return TraceStep(LIGHT, False, tr("it is as at calibration, or cannot be corrected"))
    return _corrected_light(light.share)


def _corrected_light(gain: NDArray[np.float64]) -> TraceStep:
    """Return the trace step about a light (3,), over that at calibration, that is corrected."""
    shares = ", ".join(f"{share:.4f}" for share in gain)
    reason = tr("red, green and blue are {shares} of those at calibration, which is corrected")
    return TraceStep(LIGHT, True, reason.format(shares=shares), 0.0)
