"""Every control can be reached and read: no page is cut at any supported size."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from layout_check import faults
from layout_walk import walk
from pyqtgraph import PlotWidget
from PySide6.QtWidgets import QLabel, QPushButton, QScrollArea, QToolBar, QWidget
from pytestqt.qtbot import QtBot

from app.context.context import AppContext

HERE = Path(__file__).parent


def test_nothing_is_cut_on_any_page_at_four_sizes(context: AppContext) -> None:
    assert list(walk(context)) == []


def test_nothing_is_cut_in_german_at_twice_the_scale(tmp_path: Path) -> None:
    environment = {
        **os.environ,
        "QT_SCALE_FACTOR": "2",
        "LANGUAGE": "de",
        "QT_QPA_PLATFORM": "offscreen",
        "PYTHONPATH": os.pathsep.join((str(HERE), str(HERE.parents[1]))),
    }
    done = subprocess.run(
        [sys.executable, str(HERE / "layout_walk.py"), str(tmp_path)],
        env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["2.0"]


@pytest.mark.parametrize("fault", ["outside", "narrow", "lost", "sideways", "plot"])
def test_the_check_itself_finds_faults(fault: str, qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(300, 200)
    if fault == "outside":
        QPushButton("Apply", window).move(280, 10)
    elif fault == "narrow":
        label = QLabel("A sentence that needs more room than this", window)
        label.resize(40, 20)
    elif fault == "sideways":
        area = QScrollArea(window)
        inside = QWidget()
        inside.setMinimumWidth(500)
        area.setWidget(inside)
        area.resize(300, 200)
    elif fault == "plot":
        PlotWidget(window).resize(70, 200)
    else:
        bar = QToolBar(window)
        for number in range(20):
            bar.addAction(f"Action {number}")
        bar.resize(200, 40)
        window.show()
        arrow = bar.findChild(QWidget, "qt_toolbar_ext_button")
        arrow.hide()
    window.show()
    assert len(faults(window)) >= 1
