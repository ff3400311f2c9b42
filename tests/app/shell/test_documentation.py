"""The documentation is found where it is."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QUrl
from PySide6.QtGui import QAction, QDesktopServices
from pytestqt.qtbot import QtBot

from app.shell import main_window as main_window_module
from app.shell.context import AppContext
from app.shell.documentation import find_documentation
from app.shell.main_window import MainWindow


def write(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("here", "utf-8")
    return path


def test_the_site_is_shown_before_the_pages_that_it_is_made_of(tmp_path: Path) -> None:
    assert find_documentation(tmp_path) is None
    page = write(tmp_path / "docs" / "index.md")
    assert find_documentation(tmp_path) == page
    site = write(tmp_path / "site" / "index.html")
    assert find_documentation(tmp_path) == site


def test_a_checkout_has_its_documentation() -> None:
    assert find_documentation() is not None


def test_the_help_menu_opens_the_documentation(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    opened: list[QUrl] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: not opened.append(url))
    window = MainWindow(context=context)
    qtbot.addWidget(window)
    action = window.findChild(QAction, "help.documentation")
    assert action is not None
    action.trigger()
    assert Path(opened[0].toLocalFile()).name in ("index.html", "index.md")

    monkeypatch.setattr(main_window_module, "find_documentation", lambda: None)
    said: list[str] = []
    monkeypatch.setattr(context.toasts, "show", lambda text, *_a, **_k: said.append(text))
    action.trigger()
    assert "without the documentation" in said[0]
    window.close()
