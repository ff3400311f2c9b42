"""A person at the window, for the images of the documentation: clicks, waits, takes images."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import QEventLoop, Qt, QTimer
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from app.window.main_window import MainWindow

POLL_MS = 20
PATIENCE_S = 900.0
"""Other people may be using the machine; nothing here takes a tenth of it on a quiet one."""
QUALITY = 82
"""Of WebP: text stays sharp, and a window is 30 to 80 kB."""


class Operator:
    """Works the program as a person does, and keeps images of it.

    Parameters
    ----------
    window : MainWindow
        The program.
    folder : Path
        Where the images go.
    """

    def __init__(self, window: MainWindow, folder: Path) -> None:
        self.window, self._folder = window, folder
        self.taken: list[str] = []

    def pause(self, seconds: float) -> None:
        """Let the program run for a while."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, "time passes")

    def until(self, done: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
        """Let the program run until something is so.

        Raises
        ------
        TimeoutError
            If it does not come.
        """
        loop, poll = QEventLoop(), QTimer()
        end = time.monotonic() + patience_s
        poll.timeout.connect(lambda: loop.quit() if done() or time.monotonic() > end else None)
        poll.start(POLL_MS)
        loop.exec()
        poll.stop()
        if not done():
            raise TimeoutError(f"waited in vain: {what}")

    def see(self, name: str, within: QWidget | None = None) -> QWidget:
        """Return a widget that can be seen.

        Raises
        ------
        LookupError
            If there is none of that name.
        """
        widgets = (within or self.window).findChildren(QWidget, name)
        found = [widget for widget in widgets if widget.isVisible()]
        if not found:
            raise LookupError(f"{name} cannot be seen")
        return found[0]

    def click(self, name: str, within: QWidget | None = None) -> None:
        """Click on something as soon as it can be clicked."""
        widget = self.see(name, within)
        self.until(widget.isEnabled, f"{name} is enabled")
        QTest.mouseClick(widget, Qt.MouseButton.LeftButton)

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier | None = None) -> None:
        """Press a key in the window."""
        held = Qt.KeyboardModifier.NoModifier if modifier is None else modifier
        QTest.keyClick(self.window.focusWidget() or self.window, key, held)

    def shot(self, name: str, of: QWidget | None = None) -> None:
        """Keep an image of the window, or of a dialog.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        self.pause(0.4)
        image = (of or self.window).grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
        rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
        rgb = rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3)
        path = self._folder / f"{name}.webp"
        if not cv2.imwrite(str(path), rgb[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, QUALITY]):
            raise OSError(f"{path} cannot be written")
        self.taken.append(name)
        print(f"{path}  {path.stat().st_size / 1e3:.0f} kB", flush=True)
