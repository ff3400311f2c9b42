"""The wizard on the virtual sensor: how it fares while it looks for what a step needs."""

from __future__ import annotations

import gc
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from probes import Lateness, Spent, reported, resident_mb
from PySide6.QtCore import QCoreApplication, QEvent, QEventLoop, QObject, QTimer
from PySide6.QtWidgets import QApplication, QGraphicsView

from app.calibrate.page import CalibratePage
from app.calibrate.wizard import Wizard
from app.desktop import make_context
from app.live.live_view import LiveView
from app.shell.main_window import MainWindow

SETTLE_S = 5.0
COMPUTED_S = 1200.0
POLL_MS = 20
WINDOW = 1600, 1000


class Paints(QObject):
    """Counts the paint events that show a new frame."""

    def __init__(self, view: LiveView) -> None:
        super().__init__()
        self._view, self._seen, self.count = view, view.shown_frames, 0
        for image in view.findChildren(QGraphicsView):
            image.viewport().installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Look at paint events, and let all pass."""
        if event.type() == QEvent.Type.Paint and self._view.shown_frames != self._seen:
            self._seen = self._view.shown_frames
            self.count += 1
        return False


def show_wizard(session: Path, steps: Sequence[str], seconds: float, *, rounds: int) -> None:
    """Measure the wizard on a copy of a session, for `seconds` at each step, and print it."""
    with tempfile.TemporaryDirectory() as scratch:
        copied = Path(scratch) / "session"
        shutil.copytree(session, copied)
        context = make_context(
            settings_file=Path(scratch) / "desktop.ini", log_folder=Path(scratch) / "log"
        )
        context.workspace.folder = Path(scratch) / "workspace"
        window = MainWindow(context=context)
        window.resize(*WINDOW)
        window.show()
        context.source.choose_virtual_sensor()
        page = window.page("calibrate")
        assert isinstance(page, CalibratePage)
        window.show_page("calibrate")
        if rounds:
            open_and_close(page, copied, rounds)
        else:
            watch_steps(page, copied, steps, seconds)
        window.close()


def watch_steps(page: CalibratePage, session: Path, steps: Sequence[str], seconds: float) -> None:
    """Measure each step after everything that the session holds has been computed."""
    page.open_path(session)
    wizard = page.wizard
    assert wizard is not None
    lateness, began = Lateness(), Spent()
    wait(lambda: not wizard.model.jobs.busy, COMPUTED_S)
    print(f"computed in {began.wall_s:.0f} s; {began.reported()}")
    print(reported("lateness of the user interface meanwhile", lateness.late_ms, "ms"))
    for key in steps:
        watch_step(wizard, key, lateness, seconds)
    lateness.timer.stop()
    before = time.monotonic()
    page.may_close()
    print(f"closed in {time.monotonic() - before:.2f} s")


def watch_step(wizard: Wizard, key: str, lateness: Lateness, seconds: float) -> None:
    """Lay on the bench what the step needs, and measure."""
    bench = wizard.context.source.bench
    assert bench is not None
    wizard.go_to(key)
    bench.show(wizard.open.step.folder, 0)
    output: list[str] = []

    def note(item: object) -> None:
        output.append(type(item).__name__)

    wizard.model.live.processed.connect(note)
    wait(lambda: False, SETTLE_S)
    output.clear()
    lateness.late_ms.clear()
    paints, spent, memory_mb = Paints(wizard.area.view), Spent(), [resident_mb()]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        wait(lambda: False, min(30.0, max(end - time.monotonic(), 0.1)))
        memory_mb.append(resident_mb())
    print(f"{key}, {spent.wall_s:.0f} s: {wizard.panel.live.text()}")
    print(f"  shown: {paints.count / spent.wall_s:.1f} frames/s")
    print(f"  detection: {len(output) / spent.wall_s:.1f} a second, median "
          f"{wizard.model.live.processing_ms:.0f} ms")  # fmt: skip
    print("  " + reported("lateness of the user interface", lateness.late_ms, "ms"))
    span = max(memory_mb) - min(memory_mb)
    print(f"  memory: {memory_mb[0]:.0f} MB, at the end {memory_mb[-1]:.0f}, span {span:.0f} MB")
    print("  " + spent.reported())
    wizard.model.live.processed.disconnect(note)


def open_and_close(page: CalibratePage, session: Path, rounds: int) -> None:
    """Open and close the wizard, each time until it shows and looks, and print what is left."""
    for number in range(1, rounds + 1):
        page.open_path(session)
        if page.wizard is not None:
            one_round(page.wizard)
        gc.collect()
        wait(lambda: False, 0.1)
        print(
            f"round {number}: {resident_mb():.0f} MB, {len(QApplication.allWidgets())} widgets, "
            f"{threading.active_count()} threads",
            flush=True,
        )


def one_round(wizard: Wizard) -> None:
    """Look until images are shown, then leave."""
    wizard.go_to("lens")
    wait(lambda: wizard.area.view.shown_frames > 3, 30.0)
    wizard.left.emit()


def wait(done: Callable[[], bool], seconds: float) -> None:
    """Let the program run until something is so, or the time is over."""
    loop, poll = QEventLoop(), QTimer()
    end = time.monotonic() + seconds
    poll.timeout.connect(lambda: loop.quit() if done() or time.monotonic() > end else None)
    poll.start(POLL_MS)
    loop.exec()
    poll.stop()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
