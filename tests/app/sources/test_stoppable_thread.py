"""Threads end before the program, even inside a library's long call."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from app.sources.stoppable_thread import join, join_unfinished_threads

ROOT = Path(__file__).resolve().parents[3]

CLOSING = """
import sys, threading, time
import numpy as np
from PySide6.QtCore import QTimer
from app.window import desktop
from app.window.main_window import MainWindow
from app.sources.latest import Latest
from app.sources.source import SourceFrame
import cv2

image = np.zeros((300, 400, 3), np.uint8)

begun = threading.Event()

def work(_):
    begun.set()
    end = time.monotonic() + 2.5
    while time.monotonic() < end:
        cv2.fastNlMeansDenoisingColored(image)

latest = Latest(work, name="work")

def end_while_it_works(window):
    latest.start()
    latest.submit(SourceFrame(image, 0, 0.0))
    def close():
        if not begun.is_set():
            QTimer.singleShot(20, close)
            return
        began = time.monotonic()
        latest.stop()
        print("left behind" if time.monotonic() - began > 0.9 else "ended in time")
        window.close()
    QTimer.singleShot(300, close)

shown = MainWindow.showEvent
MainWindow.showEvent = lambda self, event: (shown(self, event), end_while_it_works(self))
desktop.LAST_JOIN_S = float(sys.argv[1])
sys.exit(desktop.run([]))
"""


@pytest.fixture
def hanging():
    return threading.Event()


def test_a_thread_that_hangs_is_named_and_waited_for_again(hanging, caplog):
    thread = threading.Thread(target=hanging.wait, name="capture somewhere", daemon=True)
    thread.start()
    assert not join(thread, 0.01)
    assert not join_unfinished_threads(0.01)
    assert caplog.text.count("capture somewhere") == 2
    threading.Timer(0.05, hanging.set).start()
    assert join_unfinished_threads(60.0)


@pytest.mark.parametrize("patience_s", [60.0, 0.1], ids=["it is waited for", "it takes too long"])
def test_the_program_ends_well_while_a_library_is_at_work(patience_s):
    done = subprocess.run(
        [sys.executable, "-c", CLOSING, str(patience_s)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stdout.strip()) == (0, "left behind"), done.stderr
    assert "terminate" not in done.stderr
