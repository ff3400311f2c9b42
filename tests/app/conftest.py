"""What the tests of the desktop program share: own folders, its theme, a watch for leaks."""

import gc
import logging
import sys
import threading
import time
import traceback
import weakref
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QEvent, Qt, QThread, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import isValid

from app.program import log as program_log
from app.widgets import theme
from app.window.desktop import make_application, make_context
from gelpolight_core.base.row_threads import THREAD_NAME as ROWS_THREAD
from gelpolight_core.output.drawing_thread import THREAD_NAME as DRAWING_THREAD
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

# tqdm's monitor lives as long as the process; numba and its kind start no Python threads.
LASTING_THREADS = ("TMonitor",)
# What is waited for may be compiled first, on a busy machine; only a failing test waits so long.
GRACE_S, WAIT_MS = 60.0, 300_000
for wait in (
    QtBot.waitActive, QtBot.waitCallback, QtBot.waitExposed, QtBot.waitSignal, QtBot.waitSignals,
    QtBot.waitUntil,
):  # fmt: skip
    assert wait.__kwdefaults__["timeout"]
    wait.__kwdefaults__["timeout"] = WAIT_MS


@pytest.fixture(scope="session")
def qapp():
    """Return the program's own application, in its light theme."""
    application = make_application()
    theme.apply(application, "light")
    yield application


@pytest.fixture(autouse=True)
def _folders_of_their_own(tmp_path, monkeypatch):
    """Keep the tests out of the settings, logs and documents of whoever runs them."""
    home = tmp_path / "home"
    for variable, folder in (
        ("HOME", "."),
        ("XDG_CONFIG_HOME", "config"),
        ("XDG_DATA_HOME", "data"),
        ("XDG_STATE_HOME", "state"),
        ("XDG_CACHE_HOME", "cache"),
        ("XDG_DOCUMENTS_DIR", "documents"),
    ):
        (home / folder).mkdir(parents=True, exist_ok=True)
        monkeypatch.setenv(variable, str(home / folder))


@pytest.fixture(autouse=True)
def _a_crash_is_reported(monkeypatch):
    """Keep pytest's own crash reports on; the log of the program would redirect them to a file."""
    quiet = SimpleNamespace(enable=lambda _file: None, disable=lambda: None)
    monkeypatch.setattr(program_log, "faulthandler", quiet)


@pytest.fixture
def context(qapp, tmp_path):
    """Return what all pages are given, with an empty workspace in a folder of its own."""
    made = make_context(settings_file=tmp_path / "desktop.ini", log_folder=tmp_path / "log")
    made.workspace.folder = tmp_path / "workspace"
    made.log.start()
    yield made
    made.toasts.clear()
    made.workspace.close()
    made.log.stop()
    assert made.log._file not in logging.getLogger().handlers


class _Started:
    """Objects that were started in a test, each with the line that did it."""

    def __init__(self, running: Callable[[Any], bool]) -> None:
        self._running = running
        self._found: list[tuple[weakref.ref[Any], str]] = []

    def watch(self, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
        """Note every start of a kind of object."""
        start = kind.start

        def noted(this: Any, *arguments: Any) -> None:
            line = traceback.extract_stack(limit=2)[0]
            self._found.append((weakref.ref(this), f"{line.filename}:{line.lineno} {line.line}"))
            start(this, *arguments)

        monkeypatch.setattr(kind, "start", noted)

    def running(self) -> list[tuple[Any, str]]:
        """Return those that still run, each with the line that started it."""
        found = [(reference(), line) for reference, line in self._found]
        return [(o, line) for o, line in found if o is not None and isValid(o) and self._running(o)]

    def left(self) -> list[str]:
        """Return where those were started that still run; stop them."""
        lines = []
        for this, line in self.running():
            lines.append(line)
            if isinstance(this, QTimer):
                this.stop()
            else:
                this.quit()
        return list(dict.fromkeys(lines))


@pytest.fixture(autouse=True)
def _nothing_is_left_behind(qapp, monkeypatch):
    """Fail when a test leaves a thread, a timer or a window behind, and name it."""
    threads_before = set(threading.enumerate())
    windows_before = QApplication.topLevelWidgets()
    timers, qthreads = _Started(QTimer.isActive), _Started(QThread.isRunning)
    timers.watch(QTimer, monkeypatch)
    qthreads.watch(QThread, monkeypatch)
    # What was there before is not searched for garbage: that would take most of a test's time.
    gc.freeze()
    yield
    _delete_what_was_deleted()

    def left() -> bool:
        running = timers.running() or qthreads.running()
        return bool(running or _left_windows(windows_before))

    # What is only held by a cycle of references is not in use, and goes with it.
    if left():
        gc.collect()
        _delete_what_was_deleted()
    gc.unfreeze()
    if left():  # a cycle that goes through older objects
        gc.collect()
        _delete_what_was_deleted()
    problems = [f"timer started at {line}" for line in timers.left()]
    problems += [f"QThread started at {line}" for line in qthreads.left()]
    problems += [f"thread {name}" for name in _left_threads(threads_before)]
    if QApplication.keyboardModifiers():
        # What a key was struck with stays as if it were held, and changes what selecting does.
        QTest.keyRelease(QWidget(), Qt.Key.Key_Shift)
    for widget in _left_windows(windows_before):
        problems.append(f"window {type(widget).__name__} {widget.objectName()!r}")
        widget.close()
        widget.deleteLater()
    _delete_what_was_deleted()
    if problems:
        pytest.fail("left behind: " + "; ".join(problems), pytrace=False)


def _delete_what_was_deleted() -> None:
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    QCoreApplication.processEvents()


def _left_windows(before: list[QWidget]) -> list[QWidget]:
    return [
        widget
        for widget in QApplication.topLevelWidgets()
        if widget.parent() is None and not any(widget is old for old in before)
    ]


def _left_threads(before: set[threading.Thread]) -> list[str]:
    end = time.monotonic() + GRACE_S
    while True:
        at = sys._current_frames()
        left = [
            f"{thread.name} at {''.join(traceback.format_stack(at.get(thread.ident or 0), 6))}"
            for thread in threading.enumerate()
            if thread not in before
            and type(thread).__name__ not in LASTING_THREADS
            # These end with the solver that has them, that one with the program; they have tests
            # of their own.
            and not thread.name.startswith((ROWS_THREAD, DRAWING_THREAD))
        ]
        if not left or time.monotonic() > end:
            return left
        time.sleep(0.02)


@pytest.fixture
def dome():
    """Return a ball's cap, 0.8 mm deep, in a round working area of 8 mm radius."""
    x = np.arange(-90, 91) * 0.1
    y = np.arange(-85, 86) * 0.1
    xx, yy = np.meshgrid(x, y)
    depth = np.maximum(0.8 - (np.hypot(xx - 2.0, yy + 1.0) / 3.0) ** 2, 0.0)
    slope_y, slope_x = np.gradient(depth, 0.1)
    normals = np.stack([-slope_x, -slope_y, -np.ones_like(depth)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flags = np.where(np.hypot(xx, yy) > 8.0, Flag.OUTSIDE.value, 0).astype(np.uint8)
    flags[80:90, 40:50] |= np.uint8(Flag.DARK.value)
    return HeightMap(
        depth_mm=depth.astype(np.float32),
        x_mm=x,
        y_mm=y,
        pitch_mm=0.1,
        normals=normals.astype(np.float32),
        flags=flags,
        calibration_id="test",
        model="full",
        source="dome.png",
    )
