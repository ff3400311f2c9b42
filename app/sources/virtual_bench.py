"""The scene on the virtual sensor, as a technician arranges it, for use by any thread."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gelpolight_core.base.form_fields import choice, number
from gelpolight_core.session.reference_object import SHAPES, ReferenceObject
from gelpolight_core.simulation.rays import pixel_directions, trace_points
from gelpolight_core.simulation.sensor_design import SensorDesign, validate_design

if TYPE_CHECKING:
    from gelpolight_core.simulation.board_scene import BoardPose

BOARDS = ("checkerboard", "board_on_top")
FLAT = ("mirror", "whiteboard", "bare")
PRESSED = ("ball", "cylinder", "cuboid", "coin", "nut")
BENCH = "Virtual bench"
ITEMS = {
    "checkerboard": "Checkerboard, held",
    "board_on_top": "Checkerboard, on top",
    "mirror": "Mirror",
    "whiteboard": "Whiteboard",
    "bare": "Bare membrane",
    "ball": "Ball",
    "cylinder": "Cylinder",
    "cuboid": "Cuboid",
    "coin": "Coin",
    "nut": "Nut",
}
"""The label of each object that can be on the sensor."""

FAULTS = {
    "camera_stops": ("Camera failure", "No more images arrive, as with an unplugged cable"),
    "room_light": ("Room light on", "Light from outside falls into the sensor"),
    "membrane_on": ("Membrane mounted", "The membrane hides the mirror"),
    "too_bright": ("Overexposed", "Three times too much light"),
    "led_off": ("Blue LED off", "The blue LED gives no light"),
    "defocused": ("Out of focus", "The lens is turned away from its focus"),
    "dust": ("Dust", "Specks of dust between camera and membrane"),
}
"""Label and meaning of each fault that can be switched on."""

STAGES = {
    "checkerboard": "checkerboard",
    "top_pose": "board_on_top",
    "mirror": "mirror",
    "whiteboard": "whiteboard",
    "background": "bare",
    "scale": "cylinder",
    "balls": "ball",
    "presses": "",
}
"""Stage of a session -> object on the sensor; each press has its own shape."""

NOMINAL_EXPOSURE_MS = 10.0
"""At this exposure and gain 0 dB the images are as bright as the design specifies."""


def _is_pressed(scene: BenchScene) -> bool:
    return scene.item in PRESSED


def _is_movable(scene: BenchScene) -> bool:
    return scene.item not in FLAT


def _can_turn(scene: BenchScene) -> bool:
    """Whether a rotation is visible: not of a round object."""
    return _is_movable(scene) and scene.item not in ("ball", "cylinder")


# A coin that can be solved in seconds; the board in front of the lens may be anywhere in view.
_LARGEST_MM = 12.0
_DEEPEST_MM = 3.0
# Duration of one press of the coin that moves by itself, and the steps of its depth.
_PATH_S, _PATH_STEP_MM = 10.0, 0.05

_MM = " mm"
ABOUT_NOISE = "0 is no noise, 1 is the noise of the design"


@dataclass(frozen=True, slots=True)
class BenchScene:
    """Object on the virtual sensor, with its position and size.

    Attributes
    ----------
    item : str
        One of ITEMS.
    pose : int
        Index of the scripted pose of a hand-held checkerboard.
    x_mm, y_mm, yaw_deg : float
        Position on the top surface, sensor frame; for the hand-held checkerboard its shift in the
        camera frame, and its rotation in the board plane.
    size_mm : float
        Diameter of a ball, cylinder or coin, side of a cuboid, width across flats of a nut.
    depth_mm : float
        Depth of its foremost point.
    """

    item: str = choice("bare", "On the sensor", ITEMS)
    pose: int = 0
    x_mm: float = number(0.0, "x, right", -100, 100, _MM, 2, step=0.1, when=_is_movable)
    y_mm: float = number(0.0, "y, down", -100, 100, _MM, 2, step=0.1, when=_is_movable)
    yaw_deg: float = number(0.0, "Rotation", -180, 180, "°", 1, when=_can_turn)
    size_mm: float = number(5.0, "Size", 0, _LARGEST_MM, _MM, 2, step=0.1, when=_is_pressed)
    depth_mm: float = number(1.0, "Depth", 0, _DEEPEST_MM, _MM, 2, step=0.01, when=_is_pressed)

    @property
    def truth(self) -> ReferenceObject | None:
        """The true values of the object, if it has a shape that can be measured."""
        truth = ReferenceObject(self.item, self.size_mm, height_mm=self.depth_mm, name=BENCH)
        return truth if self.item in SHAPES else None


@dataclass(frozen=True, slots=True)
class BenchConditions:
    """Camera settings and faults.

    Attributes
    ----------
    exposure_ms, gain_db, rate_hz : float
        Settings of the camera.
    noise : float
        Factor on the noise of the design; 0 is no noise.
    faults : frozenset of str
        Names of FAULTS that are switched on.
    """

    exposure_ms: float = number(NOMINAL_EXPOSURE_MS, "Exposure", 0.1, 100.0, " ms", 2, step=0.5)
    gain_db: float = number(0.0, "Gain", 0.0, 24.0, " dB", 1)
    rate_hz: float = number(30.0, "Frame rate", 1.0, 60.0, " Hz")
    noise: float = number(1.0, "Noise", 0.0, 5.0, " times", 2, step=0.1, tip=ABOUT_NOISE)
    faults: frozenset[str] = frozenset()


RANGES = {f.name: f.metadata["span"] for f in fields(BenchConditions) if f.metadata}

_FIRST_POSITIONS: dict[str, dict[str, Any]] = {
    "board_on_top": {"x_mm": 0.35, "y_mm": -0.25, "yaw_deg": 14.0},
    "ball": {"size_mm": 8.0, "depth_mm": 1.0},
    "cylinder": {"size_mm": 5.0, "depth_mm": 1.0},
    "cuboid": {"size_mm": 5.0, "depth_mm": 1.0, "yaw_deg": 17.0},
    "coin": {"size_mm": 8.0, "depth_mm": 0.6, "yaw_deg": 10.0},
    "nut": {"size_mm": 5.5, "depth_mm": 0.8, "yaw_deg": 12.0},
}


class VirtualBench:
    """The state of the virtual bench. Values beyond a range are clipped.

    Parameters
    ----------
    design : SensorDesign, optional
        The sensor on the bench.
    seed : int, optional
        Seed of the membrane pattern and of the checkerboard poses, as in a simulated session.

    Attributes
    ----------
    scene : BenchScene
        The scene on the sensor. The methods change it.
    conditions : BenchConditions
        Camera settings and faults. The methods change them.

    Raises
    ------
    InputError
        If the design is not consistent.
    ValueError
        If the membrane is not flat, or the camera has not 8 bits.
    """

    def __init__(self, design: SensorDesign | None = None, *, seed: int = 0) -> None:
        self.design = validate_design(design or SensorDesign())
        if self.design.membrane.apex_height_mm > 0.0 or self.design.camera.bit_depth != 8:
            raise ValueError("the bench is for a flat membrane and a camera of 8 bits")
        self.seed = seed
        self._lock = threading.RLock()
        self.scene = BenchScene()
        self.conditions = BenchConditions()
        self._watchers: list[Callable[[], None]] = []
        self._path: Callable[[float], BenchScene] | None = None
        self._path_start_s = math.nan

    def play(self, path: Callable[[float], BenchScene]) -> None:
        """Let the object move by itself, until the bench is changed or :meth:`stop` is called.

        Parameters
        ----------
        path : callable
            Returns the scene at a time in s, which is 0 at the first frame.
        """
        with self._lock:
            self._set_scene(lambda _: path(0.0))
            self._path, self._path_start_s = path, math.nan

    def stop(self) -> None:
        """Leave the object where it is."""
        with self._lock:
            self._path = None

    def advance(self, time_s: float) -> None:
        """Move an object that moves by itself to where it is at the time of a frame."""
        with self._lock:
            if (path := self._path) is None:
                return
            if math.isnan(self._path_start_s):
                self._path_start_s = time_s
            self._set_scene(lambda _: path(time_s - self._path_start_s))
            self._path = path

    @property
    def is_untouched(self) -> bool:
        """Whether nothing has been put on the sensor yet."""
        return self.scene == BenchScene()

    @property
    def seen(self) -> BenchScene:
        """The scene that the camera sees: a mounted membrane hides what is behind it."""
        with self._lock:
            hidden = self.scene.item == "mirror" and "membrane_on" in self.conditions.faults
            return BenchScene() if hidden else self.scene

    @cached_property
    def poses(self) -> tuple[BoardPose, ...]:
        """The scripted poses of the hand-held checkerboard, as in a simulated session."""
        from gelpolight_core.simulation.simulated_session import (
            checkerboard_poses,  # slow to import
        )

        return checkerboard_poses(self.design, self.seed)

    def watch(self, watcher: Callable[[], None]) -> Callable[[], None]:
        """Call `watcher` after each change, in the thread that made it.

        Returns
        -------
        callable
            Removes the watcher.
        """
        with self._lock:
            self._watchers.append(watcher)

        def forget() -> None:
            with self._lock:
                self._watchers = [other for other in self._watchers if other is not watcher]

        return forget

    def place_object(self, item: str) -> BenchScene:
        """Put an object on the sensor, at its default position and size."""
        if item not in ITEMS:
            raise ValueError(f"the bench has no {item!r}")
        return self._set_scene(lambda _: BenchScene(item, **_FIRST_POSITIONS.get(item, {})))

    def set_scene(self, **values: float) -> BenchScene:
        """Change fields of the scene other than `item`, and return the new scene."""
        return self._set_scene(lambda scene: replace(scene, **_finite(values)))

    def set_conditions(self, **values: float) -> BenchConditions:
        """Change exposure_ms, gain_db, rate_hz or noise, and return the new conditions."""
        within = {
            key: min(max(value, RANGES[key][0]), RANGES[key][1])
            for key, value in _finite(values).items()
        }
        with self._lock:
            conditions = self.conditions = replace(self.conditions, **within)
        self._report()
        return conditions

    def switch(self, fault: str, on: bool) -> None:
        """Switch a fault on or off."""
        if fault not in FAULTS:
            raise ValueError(f"the bench has no fault {fault!r}")
        with self._lock:
            faults = self.conditions.faults - {fault} | ({fault} if on else set())
            self.conditions = replace(self.conditions, faults=faults)
        self._report()

    def steps(self, stage: str) -> int:
        """Return the number of images of a stage of a simulated session."""
        counts = {"balls": len(self.design.balls), "presses": len(self.design.presses)}
        return len(self.poses) if stage == "checkerboard" else counts.get(stage, 1)

    def show(self, stage: str, number: int = 0) -> BenchScene:
        """Arrange the scene of image `number` of a stage of a simulated session."""
        if stage not in STAGES or not 0 <= number < self.steps(stage):
            raise ValueError(f"a session has no {stage!r} number {number}")
        if stage == "balls":
            ball = self.design.balls[number]
            scene = BenchScene(
                "ball", 0, ball.x_mm, ball.y_mm, 0.0, 2.0 * ball.radius_mm, ball.depth_mm
            )
        elif stage == "presses":
            item = self.design.presses[number]
            scene = BenchScene(
                item.shape, 0, item.x_mm, item.y_mm, item.yaw_deg, item.size_mm, item.depth_mm
            )
        else:
            name = STAGES[stage]
            scene = BenchScene(name, number, **_FIRST_POSITIONS.get(name, {}))
        return self._set_scene(lambda _: scene)

    def drag_to(self, u: float, v: float) -> BenchScene:
        """Move the centre of the object to a point of the image (pixels)."""
        position = self.position_mm(u, v)
        return (
            self.scene if position is None else self.set_scene(x_mm=position[0], y_mm=position[1])
        )

    def position_mm(self, u: float, v: float) -> tuple[float, float] | None:
        """Return the position (x, y) at which a scene's centre is seen at a point of the image.

        None if nothing can be moved there.
        """
        scene = self.scene
        camera, layers = self.design.camera, self.design.layers
        pixel = np.array(float(u)), np.array(float(v))
        if scene.item == "checkerboard":
            centre = self.poses[scene.pose].centre_mm
            offset_mm = pixel_directions(camera, *pixel) * centre[2] - centre
            return float(offset_mm[0]), float(offset_mm[1])
        if scene.item in FLAT:
            return None
        ray = trace_points(camera, layers, *pixel)
        x, y = float(ray.x_mm), float(ray.y_mm)
        return (x, y) if math.isfinite(x) and math.isfinite(y) else None

    def depth_range_mm(self, scene: BenchScene) -> tuple[float, float]:
        """Return the largest depth of the object of a scene: for a ball its radius."""
        max_depth_mm = min(_DEEPEST_MM, 0.25 * self.design.layers.elastomer_thickness_mm)
        return 0.0, min(max_depth_mm, 0.5 * scene.size_mm) if scene.item == "ball" else max_depth_mm

    def size_range_mm(self) -> tuple[float, float]:
        """Return the range of sizes of an object."""
        diameter = self.design.membrane.working_diameter_mm
        return min(0.5, 0.1 * diameter), min(_LARGEST_MM, 0.5 * diameter)

    def reach_mm(self, scene: BenchScene) -> float:
        """Return how far from the centre the object of a scene can be moved."""
        if scene.item == "checkerboard":
            return 100.0
        return 0.5 * self.design.membrane.working_diameter_mm

    def _set_scene(self, change: Callable[[BenchScene], BenchScene]) -> BenchScene:
        with self._lock:
            scene = self.scene = self._within(change(self.scene))
        self._report()
        return scene

    def _within(self, scene: BenchScene) -> BenchScene:
        pose = int(scene.pose)
        if scene.item == "checkerboard":
            pose = min(max(pose, 0), len(self.poses) - 1)
        low, high = self.size_range_mm()
        size = min(max(scene.size_mm, low), high) if scene.item in PRESSED else scene.size_mm
        scene = replace(scene, pose=pose, size_mm=size)
        max_depth_mm = self.depth_range_mm(scene)[1]
        distance_mm, reach_mm = math.hypot(scene.x_mm, scene.y_mm), self.reach_mm(scene)
        shrink = min(1.0, reach_mm / distance_mm) if distance_mm > 0.0 else 1.0
        return replace(
            scene,
            depth_mm=min(max(scene.depth_mm, 0.0), max_depth_mm),
            x_mm=scene.x_mm * shrink,
            y_mm=scene.y_mm * shrink,
            yaw_deg=math.remainder(scene.yaw_deg, 360.0),
        )

    def _report(self) -> None:
        with self._lock:
            self._path = None
            watchers = tuple(self._watchers)
        for watcher in watchers:
            watcher()


def coin_path(time_s: float) -> BenchScene:
    """Return a coin that is pressed in, moved and lifted again and again: a path for the bench.

    It starts pressed in. The depth changes in steps, so that few shapes have to be solved.
    """
    angle_rad = math.tau * time_s / _PATH_S
    # Pressed in for most of each press, and lifted for a moment.
    phase = min(max(1.0 + 1.25 * math.cos(angle_rad), 0.0), 1.0)
    smooth = phase * phase * (3.0 - 2.0 * phase)
    depth = round(smooth * 0.6 / _PATH_STEP_MM) * _PATH_STEP_MM
    x, y = 2.6 * math.sin(0.5 * angle_rad), 1.6 * math.sin(angle_rad)
    return BenchScene("coin", 0, x, y, 10.0, 8.0, depth)


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    for key, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"{key} is {value}")
    return values
