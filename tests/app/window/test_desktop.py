"""Starting the desktop program, as a person does."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import scene
from PySide6.QtWidgets import QWidget

from app.cli.main import MENDABLE, main
from app.program.workspace import Workspace, default_folder
from app.window import desktop
from app.window.pages import PAGES
from gelpolight_core.base.errors import InputError

ROOT = Path(__file__).resolve().parents[3]
STARTED = """
import sys
from PySide6.QtCore import QTimer
from app.window import desktop
from app.window.main_window import MainWindow

def look(self):
    heavy = {"scipy", "numba", "cv2", "matplotlib"} & set(sys.modules)
    print(sorted(heavy), self._asked_for)
    sys.stdout.flush()

shown = MainWindow.showEvent
def show(self, event):
    shown(self, event)
    QTimer.singleShot(0, lambda: look(self))

MainWindow.showEvent = show
sys.exit(desktop.run([]))
"""


@pytest.mark.parametrize("page", ["start", "inspect"])
def test_the_window_is_up_before_the_numerical_libraries_and_ends_well_on_request(page):
    """On Inspect if a calibration is in use, else on Start."""
    if page == "inspect":
        workspace = Workspace(default_folder())
        workspace.use(workspace.keep_calibration(scene.calibration(), "made"))
    process = subprocess.Popen(
        [sys.executable, "-c", STARTED],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == f"[] {page}\n"
    time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    (settings,) = Path(os.environ["XDG_CONFIG_HOME"]).rglob("desktop.ini")
    assert "geometry" in settings.read_text()


def test_a_request_to_end_waits_for_what_runs_such_as_a_drawing(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    window.show()
    stop_listening = desktop._close_on_signals(window)
    signal.raise_signal(signal.SIGTERM)
    assert window.isVisible()
    qtbot.waitUntil(lambda: not window.isVisible())
    stop_listening()


@pytest.mark.parametrize(("given", "demo"), [([], []), (["--demo"], ["--demo"])])
def test_without_a_command_the_window_opens(given, demo, monkeypatch):
    asked = []
    monkeypatch.setattr(desktop, "run", lambda arguments: asked.append(arguments) or 0)
    assert main(given) == 0
    assert asked == [demo]


@pytest.mark.function("Open a file of the program from the desktop")
@pytest.mark.parametrize("name", ["sensor.gplcal", "PRESS.GPLREC"])
def test_a_file_of_ours_alone_opens_the_window_with_it(name, monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr(desktop, "run", lambda arguments: asked.append(arguments) or 0)
    assert main([str(tmp_path / name)]) == MENDABLE
    assert "does not exist" in capsys.readouterr().err
    (tmp_path / name).touch()
    assert main([str(tmp_path / name)]) == 0
    assert asked == [[str(tmp_path / name)]]


@pytest.mark.parametrize("display", ["", ":987"], ids=["none", "dead"])
def test_without_a_screen_one_sentence_says_what_to_do(display, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    with pytest.raises(InputError), desktop.screen():
        pass
    assert main([]) == MENDABLE
    assert "no display" in capsys.readouterr().err


def test_pages_are_there_before_the_library_of_the_3d_view_is_loaded():
    """It takes a second or more; until it is loaded, or where it is missing, a map is shown."""
    pages = ", ".join(entry.modules[0] for entry in PAGES)
    loaded = f"import sys, {pages}; sys.exit('pyvista' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", loaded], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
