"""The commands on a machine without the libraries of windows, and of reports and figures."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from gelpolight_core.output.recording.recording_reader import Recording

ROOT = Path(__file__).resolve().parents[2]
SIZE_SD_MM = 0.24  # of a diameter by this small sensor, as `measure` states it

# Python imports a module of this name automatically in every process that is started from here.
BLOCK = """
import sys

BLOCKED = {"PySide6", "shiboken6", "pyqtgraph", "vtk", "vtkmodules", "matplotlib", "typst"}

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(name + " is not here", name=name)

sys.meta_path.insert(0, Blocker())
"""
COMMANDS = """
import shlex, sys
from app.cli.main import main

if __name__ == "__main__":
    for line in sys.stdin:
        assert main(shlex.split(line)) == 0, line
"""
IN_PYTHON = """
    import gelpolight_core as gp
    try:
        import gelpolight_core.output.report.report_pdf_file
    except gp.InputError as error:
        print(error, file=sys.stderr)
"""


@pytest.fixture
def blocked(tmp_path):
    """Return an environment in which neither a process nor its children can import them."""
    (tmp_path / "block").mkdir()
    (tmp_path / "block" / "sitecustomize.py").write_text(BLOCK)
    path = os.pathsep.join([str(tmp_path / "block"), str(ROOT)])
    return os.environ | {"PYTHONPATH": path, "HOME": str(tmp_path)}


def test_these_libraries_are_blocked_in_a_process_and_its_children(blocked):
    """Shows that the tests below can fail."""
    modules = "PySide6.QtCore pyqtgraph vtkmodules.util matplotlib.figure typst json".split()
    each = "import importlib, sys\nfor name in sys.argv[1:]:\n try: importlib.import_module(name)"
    script = f"{each}\n except ImportError: print(name)"
    child = "import subprocess, sys; sys.exit(subprocess.call([sys.executable, *sys.argv[1:]]))"
    command = [sys.executable, "-c", child, "-c", script, *modules]
    done = subprocess.run(command, env=blocked, capture_output=True, text=True)
    assert (done.returncode, done.stdout.split()) == (0, modules[:-1]), done.stderr


def test_the_window_says_what_to_install(blocked):
    start = "from app.cli.main import main; raise SystemExit(main(['--demo']))"
    done = subprocess.run(
        [sys.executable, "-c", start], env=blocked, capture_output=True, text=True
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert 'pip install "gelpolight-studio[gui]"' in line


@pytest.mark.function("Use the library and the commands without what draws reports and figures")
def test_reports_and_figures_say_what_to_install(blocked, tmp_path):
    """In one line each, before any work."""
    for name in ("c.gplcal", "p.png"):
        (tmp_path / name).touch()
    lines = [
        "board -o b.pdf",
        "evaluate c.gplcal . -o out",
        "measure c.gplcal p.png --shape ball --report r.pdf",
        "report c.gplcal -o r.pdf",
        "stability -o out",
        "work-precision -o out",
    ]
    (tmp_path / "commands.py").write_text(COMMANDS.replace("== 0", "== 2") + IN_PYTHON)
    done = subprocess.run(
        [sys.executable, "commands.py"],
        cwd=tmp_path,
        env=blocked,
        input="\n".join(lines),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    refusals = done.stderr.splitlines()
    assert len(refusals) == len(lines) + 1
    assert all('pip install "gelpolight-studio[report]"' in refusal for refusal in refusals)
    assert not {"out", "r.pdf", "b.pdf"} & set(os.listdir(tmp_path))


@pytest.mark.function("Reconstruct and measure on a machine without window libraries")
def test_images_become_depth_maps_and_sizes(blocked, tmp_path):
    """From saved files, by the model that compiles least: also with the oldest libraries."""
    sensor = ROOT / "tests/data/2026-11-23/workspace/sensors/small-1"
    recording = sensor / "recordings/press.gplrec"
    with Recording.open(recording) as opened:
        assert cv2.imwrite(str(tmp_path / "press.png"), opened.frame(1).rgb[..., ::-1])
    (tmp_path / "commands.py").write_text(COMMANDS)
    lines = f"""inspect {sensor / "first.gplcal"}
reconstruct {sensor / "first.gplcal"} press.png -o depth --format npz,ply,tif --model paper
measure {sensor / "first.gplcal"} press.png --shape cylinder --json measured.json --model paper
batch {sensor / "first.gplcal"} press.png {recording} -o batch --model paper
benchmark {sensor / "first.gplcal"} press.png --json times.json --model paper
"""
    done = subprocess.run(
        [sys.executable, "commands.py"],
        cwd=tmp_path,
        env=blocked,
        input=lines,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    measured = json.loads((tmp_path / "measured.json").read_text())
    assert measured["diameter_mm"] == pytest.approx(5.0, abs=2.0 * SIZE_SD_MM)
    for name in ("times.json", "batch/batch.csv", "depth/press.ply"):
        assert (tmp_path / name).stat().st_size > 0, name
