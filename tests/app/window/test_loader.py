"""Slow modules are loaded in the background, and closing the window does not wait for all."""

import sys
import threading

import pytest

from app.window.loader import ModuleLoader


@pytest.fixture
def slow_modules(tmp_path, monkeypatch):
    """Return the names of two modules. Loading the first one waits for a signal."""
    (tmp_path / "loader_first.py").write_text(
        "import threading\nimport loader_gate\nloader_gate.begun.set()\nloader_gate.go.wait(60)\n"
    )
    (tmp_path / "loader_second.py").write_text("")
    gate = type(sys)("loader_gate")
    gate.begun, gate.go = threading.Event(), threading.Event()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "loader_gate", gate)
    names = ["loader_first", "loader_second"]
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    return names


def test_callbacks_run_after_their_modules_are_loaded(slow_modules, qtbot):
    loader, called = ModuleLoader(), []
    loader.when_loaded(slow_modules, lambda: called.append(set(sys.modules)))
    assert not called
    sys.modules["loader_gate"].go.set()
    qtbot.waitUntil(lambda: bool(called))
    assert set(slow_modules) <= called[0]
    loader.when_loaded(slow_modules, lambda: called.append("at once"))
    assert called[1] == "at once"


def test_a_module_that_fails_to_load_is_reported_and_blocks_nothing(qtbot, caplog):
    loader, called = ModuleLoader(), []
    loader.when_loaded(["no_such_module_anywhere"], lambda: called.append(1))
    qtbot.waitUntil(lambda: called == [1])
    assert "no_such_module_anywhere" in caplog.text
