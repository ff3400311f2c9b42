"""The File menu: recent files, import, and what the visible page exports."""

import shutil
from pathlib import Path

import pytest
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from app.program.context import AppContext
from app.sources.source import SourceInfo
from app.window.main_window import MainWindow
from app.window.pages import PageEntry


class Page(QWidget):
    """Notes what it is asked to do."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self.done: list[object] = []
        self._export = QAction("Export it", self)

    def open_path(self, path: Path) -> None:
        self.done.append(path)

    def choose_calibrations(self) -> None:
        self.done.append("import")

    def export_actions(self) -> tuple[QAction, ...]:
        return (self._export,)


class Bare(QWidget):
    """A page that exports nothing."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()


PAGES = (
    *(
        PageEntry(name, name.title(), "sensors", f"{__name__}:Page")
        for name in ("sensors", "calibrate", "inspect")
    ),
    PageEntry("bare", "Bare", "measure", f"{__name__}:Bare"),
)


@pytest.fixture
def window(context, qtbot):
    made = MainWindow(context=context, pages=PAGES)
    qtbot.addWidget(made)
    made.show_page("sensors")
    return made


def _entries(menu: QMenu) -> dict[str, QAction]:
    """Return the actions of a menu as it is when it opens, by the first word of their text."""
    menu.aboutToShow.emit()
    return {action.text().split("  ")[0]: action for action in menu.actions()}


def _session(folder: Path) -> Path:
    folder.mkdir()
    (folder / "session.toml").write_text("")
    return folder


@pytest.mark.function("Open a recent file again")
def test_each_kind_of_recent_file_is_opened_by_what_it_is_for(
    window, context, tmp_path, monkeypatch
):
    session, recording = _session(tmp_path / "monday"), tmp_path / "press.gplrec"
    recording.touch()
    window.open_session(session)
    info = SourceInfo("recording", "press", "", lambda: None, recording)  # type: ignore[arg-type, return-value]
    context.source.choose(info)
    calibration = context.workspace.folder / "sensors" / "A" / "a.gplcal"
    calibration.parent.mkdir(parents=True)
    calibration.touch()
    context.settings.add_recent("calibrations", calibration)
    used: list[Path] = []
    monkeypatch.setattr(type(context.workspace), "use", lambda _self, path: used.append(path))
    chosen: list[Path] = []
    monkeypatch.setattr(context.source, "choose_recording", chosen.append)
    entries = _entries(window.recent_menu)
    entries["monday"].trigger()
    assert window.page("calibrate").done == [session, session]
    entries["press.gplrec"].trigger()
    assert chosen == [recording] and window.page_name == "inspect"
    window.show_page("sensors")
    entries["a.gplcal"].trigger()
    assert used == [calibration] and window.page_name == "inspect"


def test_missing_files_are_shown_with_the_reason_and_cannot_be_chosen(window, tmp_path):
    gone, empty = _session(tmp_path / "gone"), _session(tmp_path / "empty")
    for folder in (gone, empty):
        window.open_session(folder)
    shutil.rmtree(gone)
    (empty / "session.toml").unlink()
    entries = _entries(window.recent_menu)
    for folder, reason in ((gone, "not found"), (empty, "session.toml")):
        assert not entries[folder.name].isEnabled()
        assert reason in entries[folder.name].text()
        assert str(folder) in entries[folder.name].toolTip()


def test_export_offers_what_the_visible_page_can_export(window):
    assert list(_entries(window.export_menu)) == ["Export it"]
    window.show_page("bare")
    (nothing,) = _entries(window.export_menu).values()
    assert not nothing.isEnabled()
