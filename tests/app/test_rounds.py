"""The wizard can be opened and closed all day: nothing is left of it, and the program ends well."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 20
# The first rounds load modules and fill caches.
SETTLED = 5
# Allocators keep some of what is freed; a wizard's frames and pictures alone are 3 MB.
KEPT_MB = 1.0

SCRIPT = """
import gc, json, sys, threading
from dataclasses import replace
from pathlib import Path
from PySide6.QtCore import QCoreApplication, QEvent, QTimer
from PySide6.QtWidgets import QApplication
from app import desktop
from app.bench.stated import stated_session
from app.calibrate.page import CalibratePage
from app.shell.main_window import MainWindow
from app.sources.bench import Bench
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.session.description import create_session

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

folder, rounds = Path(sys.argv[1]), int(sys.argv[2])
create_session(replace(stated_session(), folder=folder))
left = []

class Rounds:
    def __init__(self, window):
        self.window = window
        source = window.context.source
        source.bench = Bench(SensorDesign().scaled(0.25))
        source.choose_virtual_sensor()
        window.show_page("calibrate")
        self.page = window.page("calibrate")
        self.look = QTimer()
        self.look.timeout.connect(self.go_on)
        self.begin()

    def begin(self):
        self.page.open_path(folder)
        self.seen = []
        self.page.wizard.controller.watching.detected.connect(self.seen.append)
        self.page.wizard.go_to("lens")
        self.look.start(10)

    def go_on(self):
        wizard = self.page.wizard
        if not self.seen or wizard.pictures.view.shown_frames < 3:
            return
        self.look.stop()
        if len(left) == rounds - 1:  # the last one is still looking when the window closes
            left.append(left[-1])
            self.window.close()
            return
        wizard.left.emit()
        QTimer.singleShot(20, self.count)

    def count(self):
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        gc.collect()
        left.append((len(QApplication.allWidgets()), threading.active_count(), resident_mb()))
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


def test_twenty_rounds_leave_no_widget_thread_or_memory(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path / "session"), str(ROUNDS)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    left = json.loads(done.stdout)
    assert len(left) == ROUNDS
    widgets, threads, memory_mb = zip(*left[SETTLED:], strict=True)
    assert len(set(widgets)) == 1
    assert len(set(threads)) == 1
    steps_mb = [after - before for before, after in pairwise(memory_mb)]
    # What is loaded or compiled late shows once; what is kept of a wizard shows every time.
    assert median(steps_mb) < KEPT_MB
