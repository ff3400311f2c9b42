"""The File menu: new, open, recent files, import, export, preferences."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QMenu

from app.context.calibration_status import put_into_use
from app.services.dropping import DESCRIPTION, is_session
from app.services.settings import RECENT_KINDS
from app.widgets.actions import make_action
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from app.shell.main_window import MainWindow


class FileMenu(QMenu):
    """The menu. What can be exported depends on the visible page.

    Parameters
    ----------
    window : MainWindow
        The window with the pages.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__(tr("&File"), window)
        named(self, "file", tr("File"))
        self._window, self._context = window, window.context
        self.recent = named(QMenu(tr("&Recent files"), self), "file.recent", tr("Recent files"))
        self.recent.setToolTipsVisible(True)
        self.recent.aboutToShow.connect(self._fill_recent)
        self.exports = named(QMenu(tr("&Export"), self), "file.export", tr("Export"))
        self.exports.aboutToShow.connect(self._fill_exports)
        calibrates, has_library = (name in window.entries for name in ("calibrate", "sensors"))
        if calibrates:
            self._add("new", tr("&New sensor"), window.begin_new_sensor, "Ctrl+N", "add")
            self._add("session", tr("&Open session folder…"), window.choose_session, "Ctrl+O",
                      "folder")  # fmt: skip
            self._add("open", tr("Open &files…"), window.choose_files, "Ctrl+Alt+O")
            self.addMenu(self.recent)
            self.addSeparator()
        if has_library:
            self._add("import", tr("&Import calibrations…"), window.import_calibrations, "Ctrl+I",
                      "import")  # fmt: skip
        self.addMenu(self.exports)
        self.addSeparator()
        self._add("preferences", tr("&Preferences…"), window.show_preferences, "Ctrl+,")
        self.addSeparator()
        self._add("quit", tr("&Quit"), window.close, "Ctrl+Q")
        self._context.source.changed.connect(self._note_recording)
        self._context.requests.calibrations_changed.connect(self._note_calibration)

    def _add(
        self, name: str, text: str, slot: Callable[[], object], key: str, icon_name: str = ""
    ) -> None:
        self.addAction(
            make_action(self._window, f"file.{name}", text, slot, keys=(key,), icon_name=icon_name)
        )

    # Recent files

    def _note_recording(self) -> None:
        info = self._context.source.info
        if info is not None and info.kind == "recording" and info.file is not None:
            self._context.settings.add_recent("recordings", info.file)

    def _note_calibration(self) -> None:
        used = self._context.workspace.in_use
        if used is not None:
            self._context.settings.add_recent("calibrations", used)

    def _fill_recent(self) -> None:
        self._note_calibration()
        self.recent.clear()
        titles = {
            "sessions": tr("Sessions"),
            "calibrations": tr("Calibrations"),
            "recordings": tr("Recordings"),
        }
        for kind in RECENT_KINDS:
            paths = self._context.settings.recent(kind)
            if paths:
                self.recent.addSection(titles[kind])
            for path in paths:
                self._add_recent(kind, path)
        if self.recent.isEmpty():
            self.recent.addAction(tr("No recent files")).setEnabled(False)
            return
        self.recent.addSeparator()
        forget = self.recent.addAction(tr("Clear this list"))
        forget.triggered.connect(self._context.settings.forget_recent)

    def _add_recent(self, kind: str, path: Path) -> None:
        missing = why_missing(kind, path)
        text = f"{path.name}  ({path.parent})"
        if missing:
            text = f"{path.name}  ({missing})"
        # An ampersand in a name does not become a mnemonic.
        action = self.recent.addAction(text.replace("&", "&&"))
        action.setToolTip(plain_tip(f"{path}: {missing}" if missing else str(path)))
        action.setEnabled(not missing)
        action.triggered.connect(lambda _=False: self._open(kind, path))

    def _open(self, kind: str, path: Path) -> None:
        if kind == "sessions":
            self._window.open_session(path)
            return
        if kind == "recordings":
            self._window.open_dropped((path,))
        else:
            put_into_use(path, self._window, context=self._context)
        self._window.show_page("inspect")

    # Export

    def _fill_exports(self) -> None:
        self.exports.clear()
        offered = getattr(self._window.shown_page, "export_actions", tuple)()
        self.exports.addActions(list(offered))
        if not offered:
            text = tr("Nothing on this page: export from Sensors, Inspect or Measure")
            self.exports.addAction(text).setEnabled(False)


def why_missing(kind: str, path: Path) -> str:
    """Return why a recent file cannot be opened. Empty if it can."""
    if not path.exists():
        return tr("not found")
    if kind == "sessions" and not is_session(path):
        return tr("contains no {file}").format(file=DESCRIPTION)
    return ""
