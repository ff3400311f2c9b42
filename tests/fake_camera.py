"""A driver of cameras that do what real ones are known for: for the tests, never for people."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sources.camera_drivers.driver import CameraDevice, CameraDisconnected, CameraFormat
from app.sources.source import SourceSetting
from gelpolight_core.base.errors import InputError

C310 = CameraDevice("046d:081b@SN1", "UVC Camera (046d:081b)", "046d:081b", "/dev/video0")
FORMATS = (
    CameraFormat("MJPG", 64, 48, 30.0),
    CameraFormat("MJPG", 128, 96, 30.0),
    CameraFormat("YUYV", 64, 48, 30.0),
    CameraFormat("YUYV", 128, 96, 7.5),
    CameraFormat("YUYV", 256, 192, 2.0),
)
CONTROLS = (
    SourceSetting("exposure_auto", "Exposure by the camera", "", 0.0, 1.0, 1.0, 1.0),
    SourceSetting("exposure_ms", "Exposure", "ms", 0.1, 500.0, 0.1, 33.3),
    SourceSetting("white_balance_auto", "White balance by the camera", "", 0.0, 1.0, 1.0, 1.0),
    SourceSetting("white_balance_k", "White balance", "K", 2800.0, 6500.0, 10.0, 5200.0),
    SourceSetting("gain", "Gain", "", 0.0, 255.0, 1.0, 64.0),
    SourceSetting("rate_follows_exposure", "Rate follows the exposure", "", 0.0, 1.0, 1.0, 1.0),
    SourceSetting("sharpness", "Sharpness", "", 0.0, 255.0, 1.0, 24.0),
)


@dataclass
class FakeCamera:
    """A camera with its vices; it keeps its settings while it is closed, as real ones do.

    Attributes
    ----------
    ignores : set of str
        Settings that it takes without a word and does not change.
    refuses : set of str
        Settings that it refuses aloud.
    reads_back : dict
        Settings that it reads back wrongly.
    forgets : bool
        Whether it forgets its settings when it is opened.
    open_s : float
        How long opening takes.
    hangs : Event or None
        Opening hangs until this is set.
    stops_after : int or None
        After so many images none comes, and no error either.
    frozen : bool
        Whether it gives the same image again and again.
    """

    device: CameraDevice = C310
    formats: tuple[CameraFormat, ...] = FORMATS
    settings: dict[str, SourceSetting] = field(
        default_factory=lambda: {setting.key: setting for setting in CONTROLS}
    )
    plugged: bool = True
    in_use: bool = False
    ignores: set[str] = field(default_factory=set)
    refuses: set[str] = field(default_factory=set)
    reads_back: dict[str, float] = field(default_factory=dict)
    forgets: bool = False
    open_s: float = 0.0
    hangs: threading.Event | None = None
    stops_after: int | None = None
    frozen: bool = False
    period_s: float = 0.01
    light: Callable[[int], float] = lambda _number: 1.0
    opened: int = 0
    closed: int = 0
    calls: list[tuple[str, float]] = field(default_factory=list)


class FakeDriver:
    """A driver of some fake cameras."""

    def __init__(self, *cameras: FakeCamera) -> None:
        self.cameras = cameras or (FakeCamera(),)

    def devices(self) -> tuple[CameraDevice, ...]:
        """Return those that are plugged in."""
        return tuple(camera.device for camera in self.cameras if camera.plugged)

    def formats(self, device: CameraDevice) -> tuple[CameraFormat, ...]:
        """Return what a camera lists."""
        return self._of(device).formats

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenFake:
        """Open a camera, in its own time."""
        camera = self._of(device)
        if camera.hangs is not None:
            camera.hangs.wait(20.0)
        time.sleep(camera.open_s)
        if not camera.plugged or camera.in_use:
            raise CameraDisconnected(
                "the camera cannot be opened", where=device.name, advice="Look"
            )
        camera.opened += 1
        if camera.forgets:
            camera.settings = {setting.key: setting for setting in CONTROLS}
        return OpenFake(camera, wanted)

    def _of(self, device: CameraDevice) -> FakeCamera:
        for camera in self.cameras:
            if camera.plugged and camera.device == device:
                return camera
        raise CameraDisconnected("the camera is not there", where=device.name, advice="Plug it in")


class OpenFake:
    """A fake camera that delivers; a format that it has not gives the nearest, silently."""

    def __init__(self, camera: FakeCamera, wanted: CameraFormat | None) -> None:
        self._camera, self._number = camera, 0
        listed = camera.formats or (CameraFormat("MJPG", 64, 48, 30.0),)
        like = [
            f for f in listed if wanted and (f.width, f.height) == (wanted.width, wanted.height)
        ]
        self.format = wanted if wanted in listed else (*like, listed[0])[0]
        size = (self.format.height, self.format.width, 3)
        self._noise = np.random.default_rng(1).normal(0.0, 1.0, size)

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Return the next image: an even grey whose level follows exposure, gain and light."""
        camera = self._camera
        time.sleep(camera.period_s)
        if not camera.plugged:
            raise CameraDisconnected("the camera gives no more images", where=camera.device.name,
                             advice="Check its cable")  # fmt: skip
        if camera.stops_after is not None and self._number >= camera.stops_after:
            time.sleep(0.02)
            return None
        self._number += 0 if camera.frozen else 1
        level = (
            3.0 * camera.settings["exposure_ms"].value if "exposure_ms" in camera.settings else 90
        )
        noise = np.roll(self._noise, self._number, axis=0)
        image = np.clip(level * camera.light(self._number) + noise, 0.0, 255.0)
        # What the scene has most of is red, then green: an exchange of the channels is seen.
        return (image * np.array([1.0, 0.8, 0.6])).astype(np.uint8), time.monotonic()

    def controls(self) -> tuple[SourceSetting, ...]:
        """Return the settings; while the camera sets one by itself it cannot be written."""
        camera = self._camera
        auto = {"exposure_ms": "exposure_auto", "white_balance_k": "white_balance_auto"}
        shown = []
        for key, setting in camera.settings.items():
            by_itself = camera.settings.get(auto.get(key, ""))
            value = camera.reads_back.get(key, setting.value)
            free = by_itself is None or not by_itself.value
            shown.append(replace(setting, value=value, writable=free))
        return tuple(shown)

    def set(self, key: str, value: float) -> None:
        """Take a value into the range that the camera has, ignore it, or refuse."""
        camera = self._camera
        camera.calls.append((key, value))
        free = {control.key: control.writable for control in self.controls()}
        if key in camera.refuses or key not in camera.settings:
            raise InputError("the camera refuses", where=camera.device.name, advice="Leave it")
        if key not in camera.ignores and free[key]:
            setting = camera.settings[key]
            nearest = round(setting.step * round(value / setting.step), 10)
            within = min(max(nearest, setting.low), setting.high)
            camera.settings[key] = replace(setting, value=within)

    def close(self) -> None:
        """Note it."""
        self._camera.closed += 1


def eventually(holds: Callable[[], Any], *, within_s: float = 60.0) -> Any:
    """Wait until something is true, and return it."""
    limit = time.monotonic() + within_s
    while time.monotonic() < limit:
        if found := holds():
            return found
        time.sleep(0.005)
    raise AssertionError("it did not come true")
