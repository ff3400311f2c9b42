"""The package of the chapter on extensions, and a faulty one, found as they are installed."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from chapter import blocks

from gelpolight_core.recording.reader import Recording

ROOT = Path(__file__).resolve().parents[2]
SENSOR = ROOT / "tests/data/2026-11-23/workspace/sensors/small-1"
CHAPTER = "reference/extensions.md"
GROUPS = ("exports", "tools", "cameras")


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


PLACED = """
import sys
from pathlib import Path
import gelpolight_core as gp
from app.measure.placing import KINDS, make_tool
kind = KINDS[-1]
tool = make_tool(kind.name, [tuple(map(float, sys.argv[1:]))][: len(kind.asks)])
figure = tool.apply(gp.read_height_map(Path("press.npz"))).figures[0]
print(f"{kind.label}:{figure.value}")
"""
"""A click on the map with the last tool of the Measure page."""


def gelpolight(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run(folder, "-m", "app.command_line.main", *arguments)


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])},
        capture_output=True,
        text=True,
    )


def test_an_installed_package_adds_a_format_a_tool_and_a_camera(installed):
    calibration = str(SENSOR / "first.gplcal")
    reconstruct = ("reconstruct", calibration, "press.png", "-o", ".", "--format", "asc,npz")
    written = gelpolight(installed, *reconstruct)
    assert written.returncode == 0, written.stderr
    with np.load(installed / "press.npz") as stored:
        depth_mm, x_mm, y_mm = (stored[name] for name in ("depth_mm", "x_mm", "y_mm"))
    np.testing.assert_allclose(np.loadtxt(installed / "press.asc"), depth_mm, rtol=1e-4, atol=1e-6)
    row, column = np.unravel_index(np.nanargmax(depth_mm), depth_mm.shape)
    place = (f"{x_mm[column]:.6f}", f"{y_mm[row]:.6f}")
    measured = run(installed, "-c", PLACED, *place)
    assert measured.returncode == 0, measured.stderr
    label, depth = measured.stdout.split(":")
    assert label == "Depth at"
    assert float(depth) == pytest.approx(depth_mm[row, column], rel=1e-3)
    cameras = gelpolight(installed, "cameras")
    assert cameras.returncode == 0, cameras.stderr
    assert "One grey image" in cameras.stdout


def test_a_faulty_package_is_named_in_one_sentence_and_left_out(installed):
    faulty = "".join(f"[gelpolight.{group}]\nbad-{group} = bad_lab:thing\n" for group in GROUPS)
    install(installed, "bad_lab", faulty)
    for content, group, *command in (
        ("raise RuntimeError('no such device')", "cameras", "cameras"),
        ("thing = 3", "exports", "reconstruct", "--help"),
    ):
        (installed / "bad_lab.py").write_text(content)
        done = gelpolight(installed, *command)
        assert done.returncode == 0, done.stderr
        (line,) = (x for x in done.stderr.splitlines() if f"bad-{group}" in x)
        assert "bad_lab" in line
        assert "Traceback" not in done.stderr
