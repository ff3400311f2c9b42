"""A command loads only what it needs: commands that compute nothing respond at once."""

import subprocess
import sys

import pytest

from gelpolight_core.calibration.calibration_file import write_calibration

HEAVY = ("cv2", "matplotlib", "numba", "numpy", "scipy", "PySide6")
LOADED = f"""
import sys
from app.cli.main import main

try:
    main(sys.argv[1:])
finally:
    print("loaded:", *(name for name in {HEAVY!r} if name in sys.modules))
"""


def loaded_by(*arguments: str) -> set[str]:
    """Return the slow libraries that a command has loaded."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *arguments], capture_output=True, text=True
    )
    assert "Traceback" not in done.stderr
    return set(done.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize("arguments", [["--help"], ["no-such-command"]])
def test_help_loads_no_library(arguments):
    assert loaded_by(*arguments) == set()


def test_records_need_no_image_library(tmp_path):
    assert not loaded_by("records", "--workspace", str(tmp_path)) - {"numpy"}


@pytest.mark.function("`gelpolight board`: a checkerboard to print")
def test_a_board_needs_no_more_than_a_page(tmp_path):
    loaded = loaded_by("board", "-o", str(tmp_path / "board.pdf"))
    assert not loaded - {"numpy", "matplotlib"}
    assert (tmp_path / "board.pdf").stat().st_size > 0


def test_designs_and_calibrations_are_shown_without_drawing_or_a_window(
    small_calibration, tmp_path
):
    assert not loaded_by("design", str(tmp_path / "none.toml")) & {"matplotlib", "PySide6"}
    write_calibration(small_calibration, tmp_path / "c.gplcal")
    assert not loaded_by("inspect", str(tmp_path / "c.gplcal")) & {"matplotlib", "PySide6"}
