"""A person before the wizard, and a camera that shows what it is told."""

from __future__ import annotations

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
from app.calibrate.wizard import Wizard
from app.sources.source import Frame, Setting, SourceLost
from gelpolight_core.calibration.project import CalibrationProject

RATE_HZ = 60.0
# Far more than a loaded machine takes; only a failing test waits so long.
WAIT_MS, REST_MS = 60_000, 300_000


def read_rgb(path: Path) -> NDArray[Any]:
    """Return a picture file as a camera of its depth would deliver it."""
    raw = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    return np.ascontiguousarray(raw[..., ::-1])


class ToldCamera:
    """A camera that shows what a test tells it to, each frame with a little noise of its own."""

    kind, name = "camera", "Told camera"

    def __init__(self) -> None:
        self.size = (320, 240)
        self.broken = False
        self._rgb: NDArray[Any] | None = None
        self._number = 0
        self._lock = threading.Lock()

    def show(self, rgb: NDArray[Any]) -> None:
        """Show a picture from the next frame on."""
        with self._lock:
            self._rgb = rgb
            self.size = rgb.shape[1], rgb.shape[0]

    def open(self) -> None:
        """Refuse where the cable is out."""
        self._refuse_broken()

    def frame(self, timeout_s: float) -> Frame | None:
        """Return the next frame."""
        time.sleep(min(1.0 / RATE_HZ, timeout_s))
        self._refuse_broken()
        with self._lock:
            if self._rgb is None:
                return None
            self._number += 1
            made_s = time.monotonic()
            noise = np.random.default_rng(self._number).integers(0, 3, self._rgb.shape)
            top = np.iinfo(self._rgb.dtype).max
            shown = np.clip(self._rgb.astype(np.int64) + noise, 0, top)
            return Frame(shown.astype(self._rgb.dtype), self._number, made_s)

    def settings(self) -> tuple[Setting, ...]:
        """Return none."""
        return ()

    def set(self, key: str, value: float) -> float:
        """Refuse."""
        raise KeyError(key, value)

    def close(self) -> None:
        """Do nothing."""

    def _refuse_broken(self) -> None:
        if self.broken:
            raise SourceLost("it was unplugged", where=self.name, advice="Check its cable")


class Technician:
    """Real clicks and keys, and eyes on what the wizard says."""

    def __init__(self, page: CalibratePage, qtbot: QtBot) -> None:
        self.page, self._qtbot = page, qtbot

    @property
    def wizard(self) -> Wizard:
        """The wizard that is open."""
        assert self.page.wizard is not None
        return self.page.wizard

    @property
    def session(self) -> Path:
        """The session's folder."""
        return self.wizard.project.session.folder

    def begin(self, project: CalibrationProject, step: str) -> None:
        """Open a session at a step."""
        self.page._show_wizard(project, step=step)
        self.rest()

    def rest(self) -> None:
        """Wait until nothing is under way."""
        self._qtbot.waitUntil(lambda: not self.wizard.controller.busy, timeout=REST_MS)

    def until(self, what: Callable[[], object]) -> None:
        """Wait for something to be seen."""
        self._qtbot.waitUntil(lambda: bool(what()), timeout=WAIT_MS)

    def see(self, name: str) -> QWidget:
        """Return a widget that can be seen."""
        found = [w for w in self.page.findChildren(QWidget, name) if w.isVisible()]
        assert found, f"{name} cannot be seen"
        return found[0]

    def click(self, name: str) -> None:
        """Click on a button that can be clicked."""
        button = self.see(name)
        assert button.isEnabled(), f"{name} is disabled"
        self._qtbot.mouseClick(button, Qt.MouseButton.LeftButton)

    def state(self, key: str) -> str:
        """Return what the list of steps says of a step."""
        row = [step.key for step in self.wizard.steps].index(key)
        said = self.wizard.step_list.item(row).data(Qt.ItemDataRole.AccessibleTextRole)
        return str(said).rpartition(", ")[2]

    def capture(self) -> str:
        """Press Capture; return the picture's name as soon as it is told to be there."""
        told: list[str] = []
        self.wizard.controller.captured.connect(lambda _stage, name: told.append(name))
        self.click("calibrate.capture")
        self.until(lambda: told)
        assert (self.session / self.wizard.step.folder / told[0]).is_file()
        return told[0]
