"""The package of the chapter on extensions, and a faulty one, found as they are installed."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from chapter import blocks

from gelpolight_core.output.recording.recording_reader import Recording

ROOT = Path(__file__).resolve().parents[2]
SENSOR = ROOT / "tests/data/2026-11-23/workspace/sensors/small-1"
CHAPTER = "reference/extensions.md"


def install(folder: Path, package: str, entries: str) -> None:
    (folder / f"{package}-1.0.dist-info").mkdir()
    (folder / f"{package}-1.0.dist-info/METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n"
    )
    (folder / f"{package}-1.0.dist-info/entry_points.txt").write_text(entries)


@pytest.fixture
def installed(tmp_path):
    """Return a folder with the chapter's package, and a calibration's image."""
    (project,) = blocks(CHAPTER, "toml")
    entries = project.text.partition("[project.entry-points")[1:]
    lines = "".join(entries).replace("project.entry-points.", "").replace('"', "")
    install(tmp_path, "my_lab", lines)
    (module,) = blocks(CHAPTER, "python")
    (tmp_path / "my_lab.py").write_text(module.text)
    with Recording.open(SENSOR / "recordings/press.gplrec") as recording:
        cv2.imwrite(str(tmp_path / "press.png"), recording.frame(1).rgb[..., ::-1])
    return tmp_path


COMMANDS = """
import shlex, sys
from app.cli.main import main
for line in sys.stdin:
    assert main(shlex.split(line)) == 0, line
"""
PLACED = """
from pathlib import Path
import gelpolight_core as gp
from gelpolight_core.measurement.tools.tool_placing import make_tool
from gelpolight_core.measurement.tools.tool_registry import PALETTE, TOOLS
name, entry = list(PALETTE.items())[-1]
assert (entry.section, entry.key) == ("extensions", "")
tool = make_tool(TOOLS[name], [(0.5, -0.3)][: len(entry.prompts)])
figure = tool.apply(gp.read_height_map(Path("press.npz"))).figures[0]
print(f"{entry.label}:{figure.value}")
"""
"""A click on the map with the last tool of the Measure page."""


def run(folder: Path, script: str, *commands: str) -> subprocess.CompletedProcess[str]:
    """Run commands and a script in one process, where packages are found in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS + script],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])},
        input="\n".join(commands),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.function("Add formats, tools and cameras by other packages")
def test_an_installed_package_adds_a_format_a_tool_and_a_camera(installed):
    reconstruct = f"reconstruct {SENSOR / 'first.gplcal'} press.png -o . --format txt,npz"
    done = run(installed, PLACED, "cameras", reconstruct)
    with np.load(installed / "press.npz") as stored:
        depth_mm, x_mm, y_mm = (stored[name] for name in ("depth_mm", "x_mm", "y_mm"))
    np.testing.assert_allclose(np.loadtxt(installed / "press.txt"), depth_mm, rtol=1e-4, atol=1e-6)
    there = depth_mm[np.abs(y_mm + 0.3).argmin(), np.abs(x_mm - 0.5).argmin()]
    assert there > 0.1
    label, depth = done.stdout.splitlines()[-1].split(":")
    assert label == "Depth at"
    assert float(depth) == pytest.approx(there, rel=0.01)
    assert "One grey image" in done.stdout


def test_a_faulty_package_is_named_in_one_sentence_and_left_out(installed):
    contents = {"cameras": "raise RuntimeError('no such device')", "exports": "thing = 3"}
    for group, content in contents.items():
        entry = f"[gelpolight.{group}]\nbad-{group} = bad_{group}:thing\n"
        install(installed, f"bad_{group}", entry)
        (installed / f"bad_{group}.py").write_text(content)
    done = run(installed, "", "cameras", f"reconstruct {SENSOR / 'first.gplcal'} press.png -o .")
    for group in contents:
        (line,) = (x for x in done.stderr.splitlines() if f"bad-{group}" in x)
        assert f"bad_{group}" in line
    assert "Traceback" not in done.stderr
