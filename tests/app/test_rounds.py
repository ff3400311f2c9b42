"""The wizard can be opened and closed all day: nothing is left of it, and the program ends well."""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 9
# The first rounds load modules and fill caches.
SETTLED = 4
# Of memory that is asked for and not given back; a wizard's frames and images alone are 3 MB.
KEPT_MB = 0.1

SCRIPT = """
import gc, json, sys, threading
from dataclasses import replace
from pathlib import Path
from PySide6.QtCore import QCoreApplication, QEvent, QTimer
from PySide6.QtGui import QPixmapCache
from PySide6.QtWidgets import QApplication
sys.path.insert(0, "tests/long")
from allocated import allocated_mb
from app.window import desktop
from app.source_ui.virtual_session import virtual_session
from app.calibrate.page import CalibratePage
from app.window.main_window import MainWindow
from app.sources.virtual_bench import VirtualBench
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.session.description import create_session

folder, rounds = Path(sys.argv[1]), int(sys.argv[2])
create_session(replace(virtual_session(), folder=folder))
left = []

class Rounds:
    def __init__(self, window):
        self.window = window
        source = window.context.source
        source.bench = VirtualBench(SensorDesign().scaled(0.125))
        source.choose_virtual_sensor()
        window.show_page("calibrate")
        self.page = window.page("calibrate")
        self.poll = QTimer()
        self.poll.timeout.connect(self.go_on)
        self.begin()

    def begin(self):
        self.page.open_path(folder)
        self.window.show_page("calibrate")
        self.seen = []
        self.page.wizard.model.live.processed.connect(self.seen.append)
        self.page.wizard.go_to("lens")
        self.poll.start(10)

    def go_on(self):
        wizard = self.page.wizard
        if not self.seen or wizard.area.view.shown_frames < 3:
            return
        self.poll.stop()
        if len(left) == rounds - 1:  # the last one is still looking when the window closes
            left.append(left[-1])
            self.window.close()
            return
        wizard.left.emit()
        QTimer.singleShot(20, self.count)

    def count(self, tries=500):
        if tries and left and threading.active_count() > left[-1][1]:
            # On a busy machine a thread ends late.
            QTimer.singleShot(20, lambda: self.count(tries - 1))
            return
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        gc.collect()
        QPixmapCache.clear()  # the style keeps up to 10 MB of painted buttons
        # Given out; what the allocator keeps of freed memory goes up and down by several MB.
        given_mb, _ = allocated_mb()
        left.append((len(QApplication.allWidgets()), threading.active_count(), given_mb))
        self.begin()

shown = MainWindow.showEvent
def show(self, event):
    shown(self, event)
    QTimer.singleShot(0, lambda: setattr(self, "rounds", Rounds(self)))
MainWindow.showEvent = show
status = desktop.run([])
print(json.dumps(left))
sys.exit(status)
"""


@pytest.mark.function("Run for hours without a leak")
def test_many_rounds_leave_no_widget_thread_or_memory(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path / "session"), str(ROUNDS)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stderr) == (0, "")
    left = json.loads(done.stdout)
    assert len(left) == ROUNDS
    widgets, threads, memory_mb = zip(*left[SETTLED:], strict=True)
    assert len(set(widgets)) == 1
    assert len(set(threads)) == 1
    # A frame may be under way at any count, and what is compiled late shows once.
    assert median(after - before for before, after in pairwise(memory_mb)) < KEPT_MB
