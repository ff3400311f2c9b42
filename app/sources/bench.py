"""What lies on the virtual sensor, as a technician arranges it; safe to use from any thread."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gelpolight_core.design.sensor_design import SensorDesign, validate_design
from gelpolight_core.simulation.rays import pixel_directions, trace_points

if TYPE_CHECKING:
    from gelpolight_core.simulation.boards import BoardPose

BOARDS = ("checkerboard", "board_on_top")
FLAT = ("mirror", "whiteboard", "bare")
PRESSED = ("ball", "cylinder", "cuboid", "coin", "nut")
ITEMS = (*BOARDS, *FLAT, *PRESSED)

FAULTS = ("camera_stops", "room_light", "membrane_on", "too_bright")
"""What can be made to go wrong: the camera gives no more pictures; light from the room falls in;
the membrane was left on under the mirror; three times too much light."""

STAGES = {
    "checkerboard": "checkerboard",
    "top_pose": "board_on_top",
    "mirror": "mirror",
    "whiteboard": "whiteboard",
    "background": "bare",
    "balls": "ball",
    "presses": "",
}
"""Stage of a session -> what lies on the sensor; each press has its own shape."""

NOMINAL_EXPOSURE_MS = 10.0
"""At this exposure and gain 0 the pictures are as bright as the design says."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What the camera has before it.

    Attributes
    ----------
    item : str
        One of ITEMS.
    pose : int
        Which of the scripted poses of a hand-held checkerboard.
    x_mm, y_mm, yaw_deg : float
        Place on the top surface, sensor frame; for the hand-held checkerboard what it is moved
        by in the camera frame, and turned by in its plane.
    size_mm : float
        Diameter of a ball, cylinder or coin, side of a cuboid, width across flats of a nut.
    depth_mm : float
        How deep its foremost point goes.
    """

    item: str = "bare"
    pose: int = 0
    x_mm: float = 0.0
    y_mm: float = 0.0
    yaw_deg: float = 0.0
    size_mm: float = 5.0
    depth_mm: float = 1.0


@dataclass(frozen=True, slots=True)
class Conditions:
    """How the picture is taken.

    Attributes
    ----------
    exposure_ms, gain_db, rate_hz : float
        Settings of the camera.
    noise : float
        Times the noise of the design; 0 is none.
    faults : frozenset of str
        Those of FAULTS that are switched on.
    """

    exposure_ms: float = NOMINAL_EXPOSURE_MS
    gain_db: float = 0.0
    rate_hz: float = 30.0
    noise: float = 1.0
    faults: frozenset[str] = field(default_factory=frozenset)


CONDITION_RANGES = {
    "exposure_ms": (0.1, 100.0),
    "gain_db": (0.0, 24.0),
    "rate_hz": (1.0, 60.0),
    "noise": (0.0, 5.0),
}

# A coin that is solved in seconds; the board before the lens may be anywhere in the picture.
_LARGEST_MM = 12.0
_DEEPEST_MM = 3.0
_BOARD_REACH_MM = 100.0

_FIRST_PLACES: dict[str, dict[str, Any]] = {
    "board_on_top": {"x_mm": 0.35, "y_mm": -0.25, "yaw_deg": 14.0},
    "ball": {"size_mm": 8.0, "depth_mm": 1.0},
    "cylinder": {"size_mm": 5.0, "depth_mm": 1.0},
    "cuboid": {"size_mm": 5.0, "depth_mm": 1.0, "yaw_deg": 17.0},
    "coin": {"size_mm": 8.0, "depth_mm": 0.6, "yaw_deg": 10.0},
    "nut": {"size_mm": 5.5, "depth_mm": 0.8, "yaw_deg": 12.0},
}


class Bench:
    """The state of the virtual bench; values beyond a range are brought to its end.

    Parameters
    ----------
    design : SensorDesign, optional
        The sensor on the bench.
    seed : int, optional
        Of the membrane's pattern and of the checkerboard's poses, as in a simulated session.

    Raises
    ------
    InputError
        If the design does not hold together.
    """

    def __init__(self, design: SensorDesign | None = None, *, seed: int = 0) -> None:
        self.design = validate_design(design or SensorDesign())
        self.seed = seed
        self._lock = threading.RLock()
        self._scene = Scene()
        self._conditions = Conditions()
        self._poses: tuple[BoardPose, ...] | None = None
        self._watchers: list[Callable[[], None]] = []

    @property
    def scene(self) -> Scene:
        """What is laid on the sensor."""
        with self._lock:
            return self._scene

    @property
    def seen(self) -> Scene:
        """What the camera sees: a membrane that was left on hides what should be below it."""
        with self._lock:
            hidden = self._scene.item == "mirror" and "membrane_on" in self._conditions.faults
            return Scene() if hidden else self._scene

    @property
    def conditions(self) -> Conditions:
        """How the picture is taken."""
        with self._lock:
            return self._conditions

    @property
    def poses(self) -> tuple[BoardPose, ...]:
        """The scripted poses of the hand-held checkerboard, those of a simulated session."""
        from gelpolight_core.simulation.session import checkerboard_poses  # heavy

        with self._lock:
            if self._poses is None:
                self._poses = checkerboard_poses(self.design, self.seed)
            return self._poses

    def watch(self, watcher: Callable[[], None]) -> Callable[[], None]:
        """Have `watcher` called after each change, by the thread that made it.

        Returns
        -------
        callable
            Ends the watch.
        """
        with self._lock:
            self._watchers.append(watcher)

        def forget() -> None:
            with self._lock:
                self._watchers = [other for other in self._watchers if other is not watcher]

        return forget

    def lay(self, item: str) -> Scene:
        """Lay something on the sensor, at the place and in the size it first has."""
        if item not in ITEMS:
            raise ValueError(f"the bench has no {item!r}")
        return self._set_scene(lambda _: Scene(item, **_FIRST_PLACES.get(item, {})))

    def arrange(self, **values: float) -> Scene:
        """Change fields of the scene other than `item`; return what it is now."""
        return self._set_scene(lambda scene: replace(scene, **_finite(values)))

    def adjust(self, **values: float) -> Conditions:
        """Change exposure_ms, gain_db, rate_hz or noise; return what the conditions are now."""
        within = {
            key: min(max(value, CONDITION_RANGES[key][0]), CONDITION_RANGES[key][1])
            for key, value in _finite(values).items()
        }
        with self._lock:
            self._conditions = replace(self._conditions, **within)
            conditions = self._conditions
        self._tell()
        return conditions

    def switch(self, fault: str, on: bool) -> None:
        """Make something go wrong, or right again."""
        if fault not in FAULTS:
            raise ValueError(f"the bench has no fault {fault!r}")
        with self._lock:
            faults = self._conditions.faults - {fault} | ({fault} if on else set())
            self._conditions = replace(self._conditions, faults=faults)
        self._tell()

    def steps(self, stage: str) -> int:
        """Return how many pictures a stage of a simulated session has."""
        counts = {"balls": len(self.design.balls), "presses": len(self.design.presses)}
        return len(self.poses) if stage == "checkerboard" else counts.get(stage, 1)

    def show(self, stage: str, number: int = 0) -> Scene:
        """Arrange what picture `number` of a stage of a simulated session shows."""
        if stage not in STAGES or not 0 <= number < self.steps(stage):
            raise ValueError(f"a session has no {stage!r} number {number}")
        if stage == "balls":
            ball = self.design.balls[number]
            scene = Scene("ball", 0, ball.x_mm, ball.y_mm, 0.0, 2.0 * ball.radius_mm, ball.depth_mm)
        elif stage == "presses":
            item = self.design.presses[number]
            scene = Scene(
                item.shape, 0, item.x_mm, item.y_mm, item.yaw_deg, item.size_mm, item.depth_mm
            )
        else:
            name = STAGES[stage]
            scene = Scene(name, number, **_FIRST_PLACES.get(name, {}))
        return self._set_scene(lambda _: scene)

    def drag_to(self, u: float, v: float) -> Scene:
        """Bring the middle of what lies there under a point of the picture (pixels)."""
        place = self.place_mm(u, v)
        return self.scene if place is None else self.arrange(x_mm=place[0], y_mm=place[1])

    def place_mm(self, u: float, v: float) -> tuple[float, float] | None:
        """Return the place (x, y) of a scene whose middle is under a point of the picture.

        None where nothing can be moved there.
        """
        scene = self.scene
        camera, layers = self.design.camera, self.design.layers
        place = np.array(float(u)), np.array(float(v))
        if scene.item == "checkerboard":
            centre = self.poses[scene.pose].centre_mm
            there = pixel_directions(camera, *place) * centre[2] - centre
            return float(there[0]), float(there[1])
        if scene.item in FLAT:
            return None
        ray = trace_points(camera, layers, *place)
        x, y = float(ray.x_mm), float(ray.y_mm)
        return (x, y) if math.isfinite(x) and math.isfinite(y) else None

    def depth_range_mm(self, scene: Scene) -> tuple[float, float]:
        """Return how deep the object of a scene can go: a ball no deeper than its middle."""
        deepest = min(_DEEPEST_MM, 0.25 * self.design.layers.elastomer_thickness_mm)
        return 0.0, min(deepest, 0.5 * scene.size_mm) if scene.item == "ball" else deepest

    def size_range_mm(self) -> tuple[float, float]:
        """Return how small and large an object can be."""
        diameter = self.design.membrane.working_diameter_mm
        return min(0.5, 0.1 * diameter), min(_LARGEST_MM, 0.5 * diameter)

    def reach_mm(self, scene: Scene) -> float:
        """Return how far from the middle the object of a scene can be moved."""
        if scene.item == "checkerboard":
            return _BOARD_REACH_MM
        return 0.5 * self.design.membrane.working_diameter_mm

    def _set_scene(self, change: Callable[[Scene], Scene]) -> Scene:
        with self._lock:
            self._scene = self._within(change(self._scene))
            scene = self._scene
        self._tell()
        return scene

    def _within(self, scene: Scene) -> Scene:
        pose = int(scene.pose)
        if scene.item == "checkerboard":
            pose = min(max(pose, 0), len(self.poses) - 1)
        low, high = self.size_range_mm()
        size = min(max(scene.size_mm, low), high) if scene.item in PRESSED else scene.size_mm
        scene = replace(scene, pose=pose, size_mm=size)
        deepest = self.depth_range_mm(scene)[1]
        away, reach = math.hypot(scene.x_mm, scene.y_mm), self.reach_mm(scene)
        shrink = min(1.0, reach / away) if away > 0.0 else 1.0
        return replace(
            scene,
            depth_mm=min(max(scene.depth_mm, 0.0), deepest),
            x_mm=scene.x_mm * shrink,
            y_mm=scene.y_mm * shrink,
            yaw_deg=math.remainder(scene.yaw_deg, 360.0),
        )

    def _tell(self) -> None:
        with self._lock:
            watchers = tuple(self._watchers)
        for watcher in watchers:
            watcher()


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    for key, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"{key} is {value}")
    return values
