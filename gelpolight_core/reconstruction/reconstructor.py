"""From one picture to a height map, with nothing but a calibration."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap
from gelpolight_core.reconstruction.normals import (
    ShadingMaps,
    SlopeField,
    normals_from_slopes,
    solve_slopes,
)
from gelpolight_core.reconstruction.poisson import PoissonSolver
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.translation import tr

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
    workers : int, optional
        Threads of the solve and the transforms.

    Raises
    ------
    InputError
        If the calibration was not made for the model, its lights lie nearly in one plane,
        or there is light on next to nothing of the membrane.

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
        workers: int = 2,
    ) -> None:
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
        self.workers = workers

    @cached_property
    def maps(self) -> ShadingMaps:
        """The calibration's maps as the paper's fused pass wants them."""
        return shading_maps(self.calibration)

    @cached_property
    def solver(self) -> PoissonSolver:
        """The paper's integration on the calibration's grid."""
        grid = self.calibration.table.grid
        return PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=self.workers)

    @cached_property
    def rim(self) -> RimCheck:
        """What the rim shows while nothing crosses it."""
        return rim_check(self.calibration)

    def slopes(self, frame: NDArray[Any], *, name: str = "") -> SlopeField:
        """Return the depth's slopes of a raw frame (height, width, 3), RGB.

        Raises
        ------
        InputError
            If the frame is not of the calibration's size, not in colour, or holds other numbers
            than :meth:`depth` takes.
        """
        return self._slopes(self._light(frame, name))

    def _slopes(self, light: NDArray[Any]) -> SlopeField:
        return solve_slopes(light, self.maps, workers=self.workers)

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
        light = self._light(frame, name)
        if self.model == "full":
            return self._depth_full(light, name, normals, uncertainty)
        field = self._slopes(light)
        depth_mm = self.solver.integrate(field.slope_x, field.slope_y).depth_mm
        depth_mm[(field.flags & int(Flag.OUTSIDE)) != 0] = 0.0
        shown = normals_from_slopes(field.slope_x, field.slope_y) if normals else None
        notes = self._rim_notes(light)
        return self._heightmap(np.asarray(depth_mm, np.float32), shown, field.flags, name, notes)

    def _depth_full(
        self, light: NDArray[Any], name: str, normals: bool, uncertainty: bool
    ) -> HeightMap:
        full = self.calibration.full
        assert full is not None
        result = reconstruct_full(
            as_linear(light),
            self.calibration,
            full,
            terms=self.terms,
            workers=self.workers,
            uncertainty=uncertainty,
        )
        notes = list(self._rim_notes(light))
        if result.rim == "free":
            notes.append(rim_let_go())
        if result.stopped == "damped":
            notes.append(tr("the press is deep for its lights: the near-light rounds were damped"))
        if result.stopped == "unsettled":
            notes.append(tr("the near-light rounds did not settle: damping did not help"))
        if result.stopped == "grows":
            notes.append(tr("the near-light rounds did not settle: the last was taken back"))
        notes += [note for note in (unsolved_note(result.unsolved),) if note]
        shown = result.normals if normals else None
        heightmap = self._heightmap(result.depth_mm, shown, result.flags, name, tuple(notes))
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
        )

    def _heightmap(
        self,
        depth_mm: NDArray[np.float32],
        normals: NDArray[np.float32] | None,
        flags: NDArray[np.uint8],
        name: str,
        notes: tuple[str, ...],
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

    def _rim_notes(self, light: NDArray[Any]) -> tuple[str, ...]:
        note = self.rim.note(light)
        return (note,) if note else ()

    def _light(self, frame: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a frame of the right size and kind with the camera's response undone."""
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
        return self.linearise(accepted(frame, name=name))


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
