"""Reconstruct a height map from one image and a calibration."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, HeightReliability
from gelpolight_core.health.faults import make_fault
from gelpolight_core.health.frame_health import FrameHealth
from gelpolight_core.reconstruction.closed_sensor.solver import InPlaceSolver
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.paper.paper_solver import PaperSolver
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL as IN_PLACE
from gelpolight_core.sensor.sensor_calibration import Calibration

from .frame_checks import validate_frame
from .height_map import HeightMap
from .linearise import as_linear, linearise_frame
from .solver import Solver, SolveRequest
from .trace import EFFORTS, Trace

SOLVERS: Mapping[str, type[Solver]] = MappingProxyType(
    {"paper": PaperSolver, "full": NearLightSolver, IN_PLACE: InPlaceSolver}
)
"""The solver of each model."""


class Reconstructor:
    """Reconstructs height maps, with constant data prepared once.

    Parameters
    ----------
    calibration : Calibration
        Calibration of the sensor that the images come from.
    model : str, optional
        ``paper``, ``full`` or ``in-place``; by default the one that the calibration was made for.
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
        calibration: Calibration,
        *,
        model: str | None = None,
        effort: str = "best",
        workers: int = 2,
    ) -> None:
        if effort not in EFFORTS:
            raise ValueError(f"effort = {effort!r}, expected one of {EFFORTS}")
        self.calibration = calibration
        self.model = model or calibration.model
        if self.model not in SOLVERS:
            raise ValueError(f"model = {model!r}, expected one of {(*SOLVERS,)}")
        self.effort = effort
        self.workers = workers
        self._kind = SOLVERS[self.model]
        if calibration.model not in self._kind.made_for:
            raise InputError(
                f"the calibration was made for the model {calibration.model}, not for {self.model}",
                calibration.identity,
                Remedy.OTHER_MODEL,
            )
        self._kind.refuse_unfit(calibration.data)

    @cached_property
    def solver(self) -> Solver:
        """The solver of the model."""
        return self._kind(self.calibration.data, workers=self.workers)

    @property
    def visible_depth_mm(self) -> float | None:
        """Smallest depth of a pressed flat face above the noise, or None if it is not known.

        Shallower relief reads 0 by the full model. It follows from the calibration's noise, the
        pitch, the directions of the lights and the drape. The other models do not state it.
        """
        return self.solver.visible_mm

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
            Number type of the frames to come.
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
        health = self.solver.health_check.check(frame)
        request = SolveRequest(self.effort, health=health)
        return self.solver.needs(self._evened(frame, health), request)

    def predict(self, height_map: HeightMap, *, step: int = 1) -> NDArray[np.float32]:
        """Return the image that the camera should see of a surface.

        Parameters
        ----------
        height_map : HeightMap
            By this model, on this calibration's grid.
        step : int, optional
            Only every `step`-th node along both axes, with the slopes averaged around it.

        Returns
        -------
        (rows, columns, 3) float32
            Brightness over that of the untouched membrane, for each channel of the camera; 1 where
            nothing is pressed, NaN where it is not known. Only the depth of the map is used.
        """
        return self.solver.predict(height_map, step=step)

    def residual(
        self, frame: NDArray[Any], height_map: HeightMap, *, step: int = 1
    ) -> NDArray[np.float32]:
        """Return a raw frame minus the image of a surface, as :meth:`predict`.

        The calibration of a closed sensor determines two of the three directions in which a colour
        can change; the residual has no part in the third.

        Parameters
        ----------
        frame
            As in :meth:`depth`.
        height_map, step
            As in :meth:`predict`.

        Raises
        ------
        InputError
            As in :meth:`depth`.
        """
        frame = self._evened(self._accepted(frame, height_map.source), height_map.health)
        return self.solver.residual(frame, height_map, step=step)

    def misfit(
        self, frame: NDArray[Any], height_map: HeightMap, *, largest: int = 200
    ) -> NDArray[np.float32]:
        """Return how far a raw frame is from the image of its surface.

        Parameters
        ----------
        frame, height_map
            As in :meth:`residual`.
        largest : int, optional
            Most nodes per side.

        Returns
        -------
        (rows, columns) float32
            Root mean square of :meth:`residual` over the channels, on a thinned grid; NaN where no
            channel is known.

        Raises
        ------
        InputError
            As in :meth:`depth`.
        """
        step = max(-(-max(height_map.depth_mm.shape) // largest), 1)
        residual = self.residual(frame, height_map, step=step)
        finite_mask = np.isfinite(residual)
        count = np.where(finite_mask.any(axis=-1), finite_mask.sum(axis=-1), np.nan)
        square = (np.where(finite_mask, residual, 0.0) ** 2).sum(axis=-1)
        return np.asarray(np.sqrt(square / count), np.float32)

    def depth(
        self,
        frame: NDArray[Any],
        *,
        name: str = "",
        normals: bool = True,
        uncertainty: bool = False,
        everywhere: bool = False,
        health: FrameHealth | None = None,
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
        everywhere : bool, optional
            Whether the full model also solves what no contact has touched, which otherwise reads 0.
        health : FrameHealth, optional
            Health check of this frame; by default the quick check for live images is made.

        Raises
        ------
        InputError
            If the frame has another size than the calibration, or another number type than these.
        """
        frame = self._accepted(frame, name)
        health = self.solver.health_check.check(frame) if health is None else health
        request = SolveRequest(self.effort, normals, uncertainty, everywhere, health)
        solved = self.solver.depth(self._evened(frame, health), request)
        fault, grid, noise = self.calibration.fault, self.calibration.table.grid, solved.noise
        failed = () if fault is None else (fault,)
        return HeightMap(
            depth_mm=solved.depth_mm,
            x_mm=grid.x_mm,
            y_mm=grid.y_mm,
            pitch_mm=grid.pitch_mm,
            normals=solved.normals,
            flags=solved.flags,
            calibration_id=self.calibration.identity,
            model=self.model,
            source=name,
            findings=(*failed, *health.findings, *solved.findings),
            **({} if noise is None else {f.name: getattr(noise, f.name) for f in fields(noise)}),
            depth_scale_sd=solved.depth_scale_sd,
            lateral_scale_sd=solved.lateral_scale_sd,
            visible_depth_mm=solved.visible_depth_mm,
            image_blur_mm=solved.image_blur_mm,
            trace=solved.trace,
            health=health,
            lateral_per_mm=solved.lateral_per_mm,
            at_rest=self.calibration.table.surface,
        )

    def health(self, frame: NDArray[Any], *, name: str = "", loss: float = 0.0) -> FrameHealth:
        """Return the faults of a frame, each with cause and remedy.

        The whole image is searched for bad pixels, and large movements of the camera are followed.
        Of a closed sensor only faults that no press can cause are known.

        Parameters
        ----------
        frame, name
            As in :meth:`depth`.
        loss : float, optional
            By compression of its file, as of
            :class:`~gelpolight_core.image.linear_image.LinearImage`.

        Raises
        ------
        InputError
            As in :meth:`depth`.
        """
        frame = self._accepted(frame, name)
        health = self.solver.health_check.check(frame, whole=True)
        return replace(health, findings=(*health.findings, *self._compressed(loss)))

    def _compressed(self, loss: float) -> tuple[Finding, ...]:
        """Return a finding if compression errs by more than noise and calibration images do."""
        usual = max(self.calibration.loss, 255.0 * float(self.calibration.data.noise.max()))
        if loss <= usual:
            return ()
        coarse = make_fault("file_compressed", loss)
        return (replace(coarse, warn_limit=usual, heights=HeightReliability.STATED),)

    def _evened(self, frame: NDArray[Any], health: FrameHealth | None) -> NDArray[Any]:
        """Return a frame without bad pixels, and without an uneven change of its light.

        If it has the latter, it is in linear light then.
        """
        if health is not None and health.bad is not None:
            frame = health.bad.fill_bad_pixels(frame)
        light = None if health is None else health.light
        if light is None or light.is_even:
            return frame
        return light.evened(as_linear(linearise_frame(frame, self.calibration.response)))

    def _accepted(self, frame: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a frame of the correct size in the number type of all steps."""
        camera = self.calibration.camera
        if frame.shape != (camera.height, camera.width, 3):
            shape = "x".join(str(n) for n in (*frame.shape[1::-1], *frame.shape[2:]))
            raise InputError(
                f"the image is {shape}, the calibration is for {camera.width}x{camera.height}x3",
                name or "image",
                Remedy.SAME_SENSOR,
            )
        return self.calibration.data.bad_pixels.fill_bad_pixels(validate_frame(frame, name=name))
