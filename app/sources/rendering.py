"""Noise-free images of the virtual sensor, rendered in the background; the newest scene wins."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from app.sources.bench import BOARDS, PRESSED, Bench, Scene
from app.sources.stopping import RENDERING, Worker, lower_priority
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.boards import BoardPose, board_on_top
from gelpolight_core.simulation.compiled import Interrupt, never
from gelpolight_core.simulation.indenters import Ball, Cuboid, Cylinder, Indenter, coin, nut
from gelpolight_core.simulation.session import pressed_membrane
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    Checkerboard,
    Mirror,
    PressedMembrane,
    State,
    VirtualSensor,
    Whiteboard,
)

Map = NDArray[np.float32]

# Room for the shapes of an object that moves by itself, at each of its depths: 50 MB.
_KEPT_CELLS = 2_000_000
_DARK = 1e-6  # far below one count of any camera


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """A noise-free image.

    Attributes
    ----------
    scene : Scene
        The scene that it shows.
    signal : (rows, columns) or (rows, columns, 3) float32
        Linear light at the nominal exposure, 1 is full scale; grey for boards.
    exact : bool
        False for the coarse image that is shown until the exact one is ready.
    """

    scene: Scene
    signal: Map
    exact: bool


class _Superseded(Exception):
    """A newer scene is requested, or none is needed any more."""


class Renderer(Worker):
    """Renders requested scenes in a separate thread, which runs until it is stopped.

    Parameters
    ----------
    bench : Bench
        Gives the design and the checkerboard poses.
    """

    def __init__(self, bench: Bench) -> None:
        super().__init__("virtual sensor")
        self._bench = bench
        self._changed = threading.Condition()
        self._wanted: Scene | None = None
        self._newest: Rendering | None = None
        self._failure: Exception | None = None
        self.start()

    def request(self, scene: Scene) -> None:
        """Request a scene; it replaces all earlier requests."""
        with self._changed:
            if scene != self._wanted:
                self._wanted = scene
                self._changed.notify_all()

    def newest(self, timeout_s: float) -> Rendering | None:
        """Return the newest image, waiting for the first one; None if there is none in time.

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
        try:
            makers = _Makers(self._bench)
            done: Scene | None = None
            while not end.is_set():
                scene = self._next(done)
                if scene is None:
                    continue
                try:
                    self._publish(makers.preview(scene, self._check_open))
                    makers.get_ready(self._check_open)
                    self._publish(makers.exact(scene, partial(self._check_newest, scene)))
                except _Superseded:
                    continue
                done = scene
        except Exception as error:  # raised again in the thread that waits for images
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _next(self, done: Scene | None) -> Scene | None:
        """Wait for another scene than the last one; None if none is requested in time."""
        with self._changed:
            changed = self._changed.wait_for(lambda: self._wanted not in (None, done), 0.1)
            return self._wanted if changed else None

    def _check_open(self) -> None:
        if self._end.is_set():
            raise _Superseded

    def _check_newest(self, scene: Scene) -> None:
        self._check_open()
        with self._changed:
            if self._wanted != scene:
                raise _Superseded

    def _publish(self, rendering: Rendering | None) -> None:
        if rendering is not None:
            with self._changed:
                self._newest = rendering
                self._changed.notify_all()


class _Makers:
    """The virtual sensor at full image size, and at a small size for previews."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        scale = 480 / bench.design.camera.width_px
        self._small_design = bench.design.scaled(scale) if scale < 1.0 else None
        self._small: VirtualSensor | None = None
        self._large: VirtualSensor | None = None
        self._bare: Map | None = None
        self._shapes: dict[tuple[int, Scene], PressedMembrane] = {}

    def get_ready(self, interrupt: Interrupt) -> None:
        """Create the full-size sensor, once."""
        if self._large is None:
            design, seed = self._bench.design, self._bench.seed
            self._large = VirtualSensor(design, seed, interrupt=interrupt)

    def exact(self, scene: Scene, interrupt: Interrupt) -> Rendering:
        """Return the exact image."""
        assert self._large is not None
        interrupt()
        state = self._state(self._bench.design, scene, interrupt)
        return Rendering(scene, _light(self._large, state, scene, interrupt), True)

    def preview(self, scene: Scene, interrupt: Interrupt) -> Rendering | None:
        """Return a quick coarse image; None if the exact one is as quick."""
        if self._small_design is None:
            return None
        if self._small is None:
            self._small = VirtualSensor(self._small_design, self._bench.seed, interrupt=interrupt)
        state = self._state(self._small_design, scene, interrupt)
        small = _light(self._small, state, scene, interrupt, samples=1)
        return Rendering(scene, self._full_size(small, scene), False)

    def _state(self, design: SensorDesign, scene: Scene, interrupt: Interrupt) -> State:
        """Return the state of a design: an object's shape is solved once, wherever it is."""
        if scene.item not in PRESSED or design.membrane.apex_height_mm > 0.0:
            return state_of(self._bench, design, scene, interrupt)
        key = design.camera.width_px, replace(scene, x_mm=0.0, y_mm=0.0)
        if (state := self._shapes.get(key)) is None:
            made = state_of(self._bench, design, key[1], interrupt)
            if not isinstance(made, PressedMembrane):
                return made
            room = max(2, _KEPT_CELLS // made.surface.depth_mm.size)  # a preview and its image
            while len(self._shapes) >= room:
                del self._shapes[next(iter(self._shapes))]
            state = self._shapes[key] = made
        old = state.surface
        return PressedMembrane(
            replace(old, x0_mm=old.x0_mm + scene.x_mm, y0_mm=old.y0_mm + scene.y_mm)
        )

    def _full_size(self, small: Map, scene: Scene) -> Map:
        if scene.item in BOARDS or self._small is None or self._large is None:
            return self._enlarged(small)
        # A press changes the bare membrane's image by a smooth factor, so that the membrane's fine
        # pattern stays sharp; the same is true at its edge, where there is no division.
        if self._bare is None:
            self._bare = self._large.brightness(BareMembrane()).astype(np.float32)
        bare = self._small.brightness(BareMembrane()).astype(np.float32)
        outside = (bare.max(axis=2) < _DARK).astype(np.uint8)
        inside = cv2.dilate(outside, np.ones((5, 5), np.uint8)) == 0
        factor = np.ones_like(bare)
        np.divide(small, np.maximum(bare, _DARK), out=factor, where=inside[..., None])
        return self._bare * self._enlarged(factor)

    def _enlarged(self, image: Map) -> Map:
        camera = self._bench.design.camera
        return np.asarray(
            cv2.resize(image, (camera.width_px, camera.height_px), interpolation=cv2.INTER_LINEAR)
        )


def _light(
    sensor: VirtualSensor, state: State, scene: Scene, interrupt: Interrupt, *, samples: int = 3
) -> Map:
    light = sensor.brightness(state, samples=samples, interrupt=interrupt).astype(np.float32)
    return light[..., 0] if scene.item in BOARDS else light


def state_of(
    bench: Bench, design: SensorDesign, scene: Scene, interrupt: Interrupt = never
) -> State:
    """Return the sensor state that a design shows for a scene of the bench.

    Parameters
    ----------
    bench : Bench
        Gives the checkerboard poses.
    design : SensorDesign
        Design of the bench, or a scaled one.
    scene : Scene
        The scene on the sensor.
    interrupt : callable, optional
        Called repeatedly; raises an exception to stop the work.
    """
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
        _indenter(scene),
        x_mm=scene.x_mm,
        y_mm=scene.y_mm,
        yaw_deg=scene.yaw_deg,
        interrupt=interrupt,
    )


def _shifted(pose: BoardPose, scene: Scene) -> BoardPose:
    """Return a scripted pose, moved in the camera frame and rotated in the board's plane."""
    yaw = math.radians(scene.yaw_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    moved = pose.centre_mm + np.array([scene.x_mm, scene.y_mm, 0.0])
    return replace(pose, axes=turn @ pose.axes, centre_mm=moved)


def _indenter(scene: Scene) -> Indenter:
    if scene.item == "ball":
        return Ball(0.5 * scene.size_mm, scene.depth_mm)
    if scene.item == "cylinder":
        return Cylinder(scene.size_mm, scene.depth_mm)
    if scene.item == "cuboid":
        return Cuboid(scene.size_mm, scene.depth_mm)
    return (coin if scene.item == "coin" else nut)(scene.size_mm, scene.depth_mm)
