"""The library guide's examples are run as they stand, in their order, in one folder."""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest
from chapter import DOCS, blocks

from app.command_line.main import main
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration

CHAPTER = "library.md"


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory, small_session: Path, small_calibration: Calibration
) -> Path:
    """Return the folder that the chapter begins with: a session and its calibration."""
    place = tmp_path_factory.mktemp("library-guide")
    (place / "session").symlink_to(small_session)
    write_calibration(small_calibration, place / "sensor.gplcal")
    return place


@pytest.fixture(scope="module")
def guide(folder: Path) -> Iterator[types.ModuleType]:
    """Return a module in which all Python examples of the chapter were run."""
    # A module of its own, for dataclasses ask for that of a class.
    module = types.ModuleType("library_guide")
    sys.modules[module.__name__] = module
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.chdir(folder)
        for block in blocks(CHAPTER, "python"):
            # Line numbers of the chapter, for whoever has to find a mistake in it.
            code = compile("\n" * (block.line - 1) + block.text, str(DOCS / CHAPTER), "exec")
            if "ProcessRunner" in block.text:
                module.__name__ = "__main__"
            exec(code, module.__dict__)
            module.__name__ = "library_guide"
    module.printed = printed.getvalue()  # type: ignore[attr-defined]
    yield module
    del sys.modules["library_guide"]


def test_every_python_example_runs(guide: types.ModuleType, folder: Path) -> None:
    """What is copied from the guide works, and leaves the files that it says."""
    assert guide.progress.done == 2
    assert guide.progress.left == 0
    for name in ("paper.gplcal", "section.csv", "balls.gplrec", "batch-out/batch.csv"):
        assert (folder / name).is_file(), name
    for ending in ("npz", "tif", "gsf", "depth.png", "ply"):
        assert (folder / "maps" / f"cylinder_s5_d100.{ending}").is_file(), ending


def test_the_examples_come_to_sensible_results(guide: types.ModuleType) -> None:
    """An example that runs but is wrong would teach the wrong thing."""
    assert guide.fit.shape == "cylinder"
    assert abs(guide.fit.size_mm - 5.0) < 0.1
    assert abs(guide.fit.height_mm - 1.0) < 0.1
    assert abs(guide.profile.along_mm[-1] - 10.0) < 1e-9
    assert abs(guide.step.value - 1.0) < 0.1
    assert guide.error_mm < 0.08
    assert guide.drift.quality.verdict == "pass"


def test_an_error_says_what_the_guide_says(guide: types.ModuleType) -> None:
    """The comments beside the three parts of an error are those parts."""
    (example,) = (b.text for b in blocks(CHAPTER, "python") if "except InputError" in b.text)
    parts = [line.partition("# ")[2] for line in example.splitlines() if "print(error." in line]
    assert len(parts) == 3
    for part in parts:
        assert part in guide.printed.splitlines()


def test_every_command_of_the_guide_runs(
    guide: types.ModuleType,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The shell's examples stand on the files that the Python ones have left."""
    monkeypatch.chdir(folder)
    commands = [line for block in blocks(CHAPTER, "sh") for line in block.text.splitlines()]
    assert commands
    for command in commands:
        name, *arguments = shlex.split(command)
        assert name == "gelpolight"
        assert main(arguments) == 0, f"{command}\n{capfd.readouterr().err}"
