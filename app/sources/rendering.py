"""Noise-free images of the virtual sensor, rendered in the background. The newest scene wins."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.simulation.board_scene import BoardPose, board_on_top
from gelpolight_core.simulation.indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    Indenter,
    coin,
    nut,
)
from gelpolight_core.simulation.simulated_session import pressed_membrane
from gelpolight_core.simulation.simulation_kernel import Interrupt, never_interrupt
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    Checkerboard,
    Mirror,
    PressedMembrane,
    SensorState,
    VirtualSensor,
    Whiteboard,
)

from .stoppable_thread import RENDERING, StoppableThread, lower_priority
from .virtual_bench import BOARDS, PRESSED, BenchScene, VirtualBench

# Room for the shapes of an object that moves by itself, at each of its depths: 50 MB.
_MAX_CELLS = 2_000_000
_INDENTERS: dict[str, Callable[[float, float], Indenter]] = {
    "ball": lambda diameter_mm, depth_mm: BallIndenter(0.5 * diameter_mm, depth_mm),
    "cylinder": CylinderIndenter,
    "cuboid": CuboidIndenter,
    "coin": coin,
    "nut": nut,
}
"""The object of a size at a depth, for each of PRESSED."""


@dataclass(frozen=True, slots=True, eq=False)
class RenderedScene:
    """A noise-free image of a scene on the virtual bench.

    Attributes
    ----------
    scene : BenchScene
        The scene that it shows.
    signal : (rows, columns) or (rows, columns, 3) float32
        Linear light at the nominal exposure, 1 is full scale. Grey for boards.
    """

    scene: BenchScene
    signal: Float32Array


class _Superseded(Exception):
    """A newer scene is requested, or none is needed any more."""


class Renderer(StoppableThread):
    """Renders requested scenes in a separate thread, which runs until it is stopped.

    Parameters
    ----------
    bench : VirtualBench
        Gives the design and the checkerboard poses.
    """

    def __init__(self, bench: VirtualBench) -> None:
        super().__init__("virtual sensor")
        self._bench = bench
        self._changed = threading.Condition()
        self._requested: BenchScene | None = None
        self._newest: RenderedScene | None = None
        self._failure: Exception | None = None
        self._shapes: dict[BenchScene, PressedMembrane] = {}
        self.start()

    def request(self, scene: BenchScene) -> None:
        """Request a scene in place of all earlier requests."""
        with self._changed:
            if scene != self._requested:
                self._requested = scene
                self._changed.notify_all()

    def newest(self, timeout_s: float) -> RenderedScene | None:
        """Return the newest image, waiting for the first one, or None if there is none in time.

        Errors of the thread are raised here.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._newest is not None or self._failure is not None, timeout_s
            )
            if self._failure is not None:
                raise self._failure
            return self._newest

    def _run(self, end: threading.Event) -> None:
        lower_priority(RENDERING)
        rendered: BenchScene | None = None
        try:
            with suppress(_Superseded):
                design, seed = self._bench.design, self._bench.seed
                sensor = VirtualSensor(design, seed, interrupt=self._check_open)
            while not end.is_set():
                scene = self._next(rendered)
                with suppress(_Superseded):
                    if scene is not None:
                        self._render(sensor, scene)
                        rendered = scene
        except Exception as error:  # raised again in the thread that waits for images
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _next(self, rendered: BenchScene | None) -> BenchScene | None:
        """Wait for another scene than the last one. Return None if none is requested in time."""
        with self._changed:
            changed = self._changed.wait_for(lambda: self._requested not in (None, rendered), 0.1)
            return self._requested if changed else None

    def _check_open(self) -> None:
        if self._end.is_set():
            raise _Superseded

    def _check_newest(self, scene: BenchScene) -> None:
        self._check_open()
        with self._changed:
            if self._requested != scene:
                raise _Superseded

    def _render(self, sensor: VirtualSensor, scene: BenchScene) -> None:
        interrupt = partial(self._check_newest, scene)
        interrupt()
        light = sensor.brightness(self._state(scene, interrupt), interrupt=interrupt)
        signal = light.astype(np.float32)
        with self._changed:
            self._newest = RenderedScene(scene, signal[..., 0] if scene.item in BOARDS else signal)
            self._changed.notify_all()

    def _state(self, scene: BenchScene, interrupt: Interrupt) -> SensorState:
        """Return the state of the sensor. The shape of an object is solved once, wherever it is."""
        if scene.item not in PRESSED:
            return state_of(self._bench, scene, interrupt)
        key = replace(scene, x_mm=0.0, y_mm=0.0)
        if (shape := self._shapes.get(key)) is None:
            state = state_of(self._bench, key, interrupt)
            if not isinstance(state, PressedMembrane):
                return state
            while len(self._shapes) >= max(1, _MAX_CELLS // state.surface.depth_mm.size):
                del self._shapes[next(iter(self._shapes))]
            shape = self._shapes[key] = state
        surface = shape.surface
        return PressedMembrane(
            replace(surface, x0_mm=surface.x0_mm + scene.x_mm, y0_mm=surface.y0_mm + scene.y_mm)
        )


def state_of(
    bench: VirtualBench, scene: BenchScene, interrupt: Interrupt = never_interrupt
) -> SensorState:
    """Return the state of the virtual sensor for a scene of the bench.

    Parameters
    ----------
    bench : VirtualBench
        Gives the design and the checkerboard poses.
    scene : BenchScene
        The scene on the sensor.
    interrupt : callable, optional
        Called repeatedly; raises an exception to stop the work.
    """
    design = bench.design
    if scene.item == "checkerboard":
        return Checkerboard(_shifted(bench.poses[scene.pose], scene))
    if scene.item == "board_on_top":
        pose = board_on_top(
            design.layers,
            working_diameter_mm=design.membrane.working_diameter_mm,
            yaw_deg=scene.yaw_deg,
            shift_mm=(scene.x_mm, scene.y_mm),
        )
        return Checkerboard(pose)
    if scene.item == "mirror":
        return Mirror()
    if scene.item == "whiteboard":
        return Whiteboard()
    if scene.item == "bare" or scene.depth_mm <= 0.0:
        return BareMembrane()
    return pressed_membrane(
        design,
        _INDENTERS[scene.item](scene.size_mm, scene.depth_mm),
        x_mm=scene.x_mm,
        y_mm=scene.y_mm,
        yaw_deg=scene.yaw_deg,
        interrupt=interrupt,
    )


def _shifted(pose: BoardPose, scene: BenchScene) -> BoardPose:
    """Return a scripted pose, moved in the camera frame and rotated in the board's plane."""
    yaw = math.radians(scene.yaw_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    rotation = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    centre_mm = pose.centre_mm + np.array([scene.x_mm, scene.y_mm, 0.0])
    return replace(pose, axes=rotation @ pose.axes, centre_mm=centre_mm)
