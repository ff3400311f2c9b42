"""A technician who uses the wizard, and a camera controlled by the test."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.calibrate.page import CalibratePage
from app.calibrate.reflectance.lut_plot import PressErrorPreview
from app.calibrate.wizard import Wizard
from app.sources.source import SourceFrame, SourceLost, SourceSetting
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.session import Session, read_session

RATE_HZ = 30.0
NOISES = 17  # more than the frames of a capture
# Much longer than a busy machine needs; only a failing test waits so long.
WAIT_MS = 300_000


def read_rgb(path: Path) -> NDArray[Any]:
    """Return an image file as a camera of its bit depth delivers it."""
    raw = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    return np.ascontiguousarray(raw[..., ::-1])


class ScriptedCamera:
    """A camera that shows the images that a test sets, with other noise in each frame."""

    kind, name = "camera", "Told camera"

    def __init__(self) -> None:
        self.size = (320, 240)
        self.broken = False
        self._rgb: NDArray[Any] | None = None
        self._noise: list[NDArray[Any]] = []
        self._number = 0
        self._lock = threading.Lock()

    def show(self, rgb: NDArray[Any]) -> None:
        """Show an image from the next frame on."""
        with self._lock:
            self._rgb = rgb
            self.size = rgb.shape[1], rgb.shape[0]
            if not self._noise or self._noise[0].shape != rgb.shape:
                random = np.random.default_rng(0)
                self._noise = [random.integers(-1, 2, rgb.shape, np.int8) for _ in range(NOISES)]

    def open(self) -> None:
        """Fail if the cable is unplugged."""
        self._refuse_broken()

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Return the next frame."""
        time.sleep(min(1.0 / RATE_HZ, timeout_s))
        self._refuse_broken()
        with self._lock:
            if self._rgb is None:
                return None
            self._number += 1
            made_s = time.monotonic()
            noise = self._noise[self._number % NOISES]
            top = np.iinfo(self._rgb.dtype).max
            shown = np.clip(self._rgb.astype(np.int32) + noise, 0, top)
            return SourceFrame(shown.astype(self._rgb.dtype), self._number, made_s)

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return no settings."""
        return ()

    def close(self) -> None:
        """Do nothing."""

    def _refuse_broken(self) -> None:
        if self.broken:
            raise SourceLost("it was unplugged", where=self.name, advice="Check its cable")


class Technician:
    """Real clicks and keys, and checks of what the wizard shows."""

    def __init__(self, page: CalibratePage, qtbot: QtBot) -> None:
        self.page, self._qtbot = page, qtbot

    @property
    def wizard(self) -> Wizard:
        """The open wizard."""
        assert self.page.wizard is not None
        return self.page.wizard

    @property
    def session(self) -> Path:
        """The folder of the session."""
        return self.wizard.project.session.folder

    @property
    def kept(self) -> Session:
        """The session as it is on disk."""
        return read_session(self.session)

    def begin(self, project: CalibrationProject, step: str) -> None:
        """Open a session at a step."""
        self.page._show_wizard(project, step=step)
        self.rest()

    def rest(self) -> None:
        """Wait until no work is in progress, which may compile what it needs first."""

        def at_rest() -> bool:
            previews, model = self.page.findChildren(PressErrorPreview), self.wizard.model
            return not (
                model.busy_with_images
                or model.jobs.busy
                or any(preview.jobs.busy for preview in previews)
            )

        self._qtbot.waitUntil(at_rest, timeout=WAIT_MS)

    def until(self, what: Callable[[], object]) -> None:
        """Wait until a condition is true."""
        self._qtbot.waitUntil(lambda: bool(what()), timeout=WAIT_MS)

    def until_live(self, words: str) -> None:
        """Wait until the line about the image says something."""
        self.until(lambda: words in self.wizard.panel.live.text())

    def save(self) -> None:
        """Save the calibration of the open result."""
        self.click("result.save")
        self.rest()

    def see(self, name: str) -> QWidget:
        """Return a visible widget."""
        found = [w for w in self.page.findChildren(QWidget, name) if w.isVisible()]
        assert found, f"{name} cannot be seen"
        return found[0]

    def click(self, name: str) -> None:
        """Click an enabled button."""
        button = self.see(name)
        assert button.isEnabled(), f"{name} is disabled"
        self._qtbot.mouseClick(button, Qt.MouseButton.LeftButton)

    def state(self, key: str) -> str:
        """Return the state that the step list shows for a step."""
        row = [one.key for one in self.wizard.steps].index(key)
        return str(self.wizard.step_list.item(row).data(Qt.ItemDataRole.UserRole))

    def capture(self) -> str:
        """Click Capture; return the image's name as soon as it is reported as saved."""
        reported: list[str] = []
        self.wizard.model.captured.connect(lambda _stage, name: reported.append(name))
        self.click("calibrate.capture")
        self.until(lambda: reported)
        assert (self.session / self.wizard.open.folder / reported[0]).is_file()
        return reported[0]
