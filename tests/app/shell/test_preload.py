"""Slow modules are loaded in the background, and closing the window does not wait for all."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import pytest

from app.shell.preload import Preload


@pytest.fixture
def slow_modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the names of two modules, the first of which waits until it is let go."""
    (tmp_path / "preload_first.py").write_text(
        "import threading\nimport preload_gate\npreload_gate.begun.set()\npreload_gate.go.wait(5)\n"
    )
    (tmp_path / "preload_second.py").write_text("")
    gate = type(sys)("preload_gate")
    gate.begun, gate.go = threading.Event(), threading.Event()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "preload_gate", gate)
    names = ["preload_first", "preload_second"]
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    return names


def test_modules_are_there_when_it_has_ended(slow_modules: list[str]) -> None:
    sys.modules["preload_gate"].go.set()
    preload = Preload(slow_modules)
    preload.start()
    preload._thread.join(5)
    assert set(slow_modules) <= set(sys.modules)
    preload.stop()


def test_what_is_not_begun_is_left_out(slow_modules: list[str]) -> None:
    preload = Preload(slow_modules)
    preload.start()
    gate = sys.modules["preload_gate"]
    assert gate.begun.wait(5)
    threading.Timer(0.05, gate.go.set).start()
    preload.stop()
    assert "preload_second" not in sys.modules


def test_one_that_was_never_started_can_be_stopped() -> None:
    Preload([]).stop()
