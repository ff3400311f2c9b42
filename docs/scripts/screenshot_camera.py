"""The scene of a camera's settings; the camera is that of the tests, with a sensor's image."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from screenshot_operator import Operator

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))

from fake_camera import FakeCamera, FakeDriver, OpenFake

from app.source_ui.camera_dialog import show_camera_dialog
from app.sources.camera_drivers.driver import CameraDevice, CameraFormat

RATE_HZ = 7.5
FORMATS = (
    CameraFormat("MJPG", 1280, 960, 30.0),
    CameraFormat("YUYV", 640, 480, 30.0),
    CameraFormat("YUYV", 1280, 960, RATE_HZ),
)
WEBCAM = CameraDevice("046d:081b@7F2A", "UVC Camera (046d:081b)", "046d:081b", "/dev/video0")
AHEAD_S = 600.0
"""Its clock is ahead: on a busy machine it comes late, and would count as from before a change."""


class SensorCamera(FakeDriver):
    """A camera that looks at a sensor.

    Parameters
    ----------
    image : Path
        What it sees, at the exposure that it is shipped with.
    """

    def __init__(self, image: Path) -> None:
        super().__init__(FakeCamera(device=WEBCAM, formats=FORMATS))
        self._image = image

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenFake:
        """Open it at once."""
        super().open(device, wanted)
        return OpenSensorCamera(self.cameras[0], wanted, self._image)


class OpenSensorCamera(OpenFake):
    """Gives the image again and again, with a little noise."""

    def __init__(self, camera: FakeCamera, wanted: CameraFormat | None, image: Path) -> None:
        super().__init__(camera, wanted)
        size = self.format.width, self.format.height
        bgr = cv2.resize(cv2.imread(str(image)), size)
        self._rgb = np.ascontiguousarray(bgr[..., ::-1]).astype(np.int16)
        self._grain = np.random.default_rng(1).integers(-2, 3, self._rgb.shape, np.int16)
        self._began_s = time.monotonic() + AHEAD_S

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Return the next image; its time is the promised one, whatever else the machine does."""
        time.sleep(1.0 / RATE_HZ)
        self._number += 1
        rgb = self._rgb + np.roll(self._grain, self._number, axis=0)
        return np.clip(rgb, 0, 255).astype(np.uint8), self._began_s + self._number / RATE_HZ


def camera_settings(operator: Operator) -> None:
    """Choose a camera, and lock it."""
    context = operator.window.context
    backgrounds = context.workspace.folder.rglob("background/*.png")
    context.cameras.driver = SensorCamera(next(iter(sorted(backgrounds))))
    context.source.choose(context.cameras.infos()[0])
    camera = context.cameras.of(context.source.info)
    assert camera is not None
    dialog = show_camera_dialog(context.cameras, camera, operator.window)
    operator.until(dialog.lock.isEnabled, "the camera")
    operator.click("camera.lock", dialog)
    operator.until(lambda: camera.state.applied and not camera.settling, "the lock")
    operator.pause(1.0)
    operator.shot("camera-settings", dialog)
    dialog.close()
    context.source.choose(None)
    operator.pause(1.0)
