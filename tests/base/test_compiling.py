"""Loops run wherever the program is installed, also where compiled code cannot be kept."""

import importlib.util
import logging
import shutil
import sys
from pathlib import Path
from types import ModuleType

import numba
import pytest

from gelpolight_core.base import compiling

LOOP = """
from gelpolight_core.base.compiling import whole

@whole()
def twice(x):
    return 2 * x
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a folder with a module of loops; nothing can be written elsewhere."""
    (tmp_path / "home").write_text("")  # a file: no folder can be made in it, not even by root
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "home" / "impossible"))
    compiling.say_that_nothing_is_kept.cache_clear()
    folder = tmp_path / "installed"
    folder.mkdir()
    (folder / "loops.py").write_text(LOOP)
    return folder


def load(folder: Path) -> ModuleType:
    """Load the module of loops as in a new start."""
    spec = importlib.util.spec_from_file_location("loops", folder / "loops.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_was_compiled_is_kept_beside_the_source(installed, caplog):
    assert load(installed).twice(2) == 4
    again = load(installed)
    assert again.twice(2) == 4
    assert sum(again.twice.stats.cache_hits.values()) == 1 and not caplog.records


@pytest.mark.function(
    "Work where nothing can be kept: compiled code in memory, said once in the log"
)
@pytest.mark.parametrize("when", ["at the start", "when it is written"])
def test_loops_run_where_nothing_can_be_kept_and_the_log_says_so_once(installed, caplog, when):
    kept = installed / "__pycache__"
    if when == "at the start":
        kept.write_text("")
    loops = load(installed)
    if when == "when it is written":
        shutil.rmtree(kept)
        kept.write_text("")
    assert loops.twice(2) == 4 and loops.twice(2.5) == 5.0
    assert [record.levelno for record in caplog.records] == [logging.WARNING]


def test_what_was_compiled_for_a_type_of_an_earlier_version_is_compiled_again(
    installed, monkeypatch
):
    monkeypatch.syspath_prepend(installed)
    (installed / "loops.py").write_text(LOOP.replace("2 * x", "x[0] + x[1]"))
    for name in ("earlier", "later"):
        (installed / f"{name}.py").write_text(
            "from typing import NamedTuple\n\nclass Pair(NamedTuple):\n    a: int\n    b: int\n"
        )
    assert load(installed).twice(importlib.import_module("earlier").Pair(1, 2)) == 3
    (installed / "earlier.py").unlink()
    monkeypatch.delitem(sys.modules, "earlier")

    loops = load(installed)

    assert loops.twice(importlib.import_module("later").Pair(1, 2)) == 3
    assert sum(loops.twice.stats.cache_misses.values()) == 1
