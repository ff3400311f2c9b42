"""The examples of the library guide and the README run as they are written."""

import contextlib
import io
import shlex
import shutil
import sys
import types
from pathlib import Path

import pytest
from chapter import DOCS, blocks

from app.cli.main import main

CHAPTER = "reference/library.md"


def _run(chapter: str, folder: Path) -> types.ModuleType:
    """Run the Python examples of a chapter in a folder; return what they defined."""
    module = types.ModuleType("examples")
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()):
        patch.chdir(folder)
        patch.setitem(sys.modules, module.__name__, module)  # dataclasses look it up
        for block in blocks(chapter, "python"):
            # Line numbers of the chapter, to find a mistake in it.
            code = compile("\n" * (block.line - 1) + block.text, str(DOCS / chapter), "exec")
            exec(code, module.__dict__)
    return module


@pytest.fixture(scope="module")
def folder(tmp_path_factory, small_session):
    """Return a folder with the session that the examples begin with, and few images of each."""
    folder = tmp_path_factory.mktemp("library-guide")
    others = ("ball_0[3-9].png", "view_0[8-9].png", "view_1*.png", "cuboid_s[5-9]*", "object*")
    shutil.copytree(small_session, folder / "session", ignore=shutil.ignore_patterns(*others))
    return folder


@pytest.fixture(scope="module")
def guide(folder):
    """Return what the examples of the library guide defined."""
    return _run(CHAPTER, folder)


@pytest.mark.function("Follow the library chapter from a session to measured sizes")
def test_the_guide_gives_sensible_results(guide, folder):
    assert guide.found.shape == "cylinder"
    assert abs(guide.fit.diameter_mm - 5.0) < 0.1
    assert abs(guide.fit.height_mm - 1.0) < 0.1
    for name in ("sensor.gplcal", "maps/cylinder_s5_d100.npz", "maps/cylinder_s5_d100.ply"):
        assert (folder / name).is_file(), name


def test_the_readme_script_is_part_of_the_guide():
    (script,) = blocks("../README.md", "python")
    guide = "".join(block.text for block in blocks(CHAPTER, "python"))
    assert script.text.replace("\n\n", "\n") in guide


def test_every_command_of_the_guide_runs(guide, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    commands = [line for block in blocks(CHAPTER, "sh") for line in block.text.splitlines()]
    assert commands
    for command in commands:
        name, *arguments = shlex.split(command)
        assert name == "gelpolight"
        assert main(arguments) == 0, f"{command}\n{capfd.readouterr().err}"
