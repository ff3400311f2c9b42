"""The menus of the main window."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu

from app.services.preferences import THEMES
from app.shell.edit_menu import EditMenu
from app.shell.file_menu import FileMenu
from app.widgets.actions import make_action
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from app.shell.main_window import MainWindow


class Menus:
    """Builds the menu bar of a window and keeps its changing parts up to date."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window
        self.themes = self._build_themes()
        self.file = FileMenu(window)
        window.menuBar().addMenu(self.file)
        self.edit = EditMenu(window)
        window.menuBar().addMenu(self.edit)
        self._build_view()
        self._build_tools()
        self._build_help()

    def _build_view(self) -> None:
        window = self._window
        menu = window.menuBar().addMenu(tr("&View"))
        menu.addActions(list(window.page_actions.values()))
        menu.addSeparator()
        menu.addMenu(tr("&Theme")).addActions(list(self.themes.values()))
        self._add(menu, "view.fullscreen", tr("&Full screen"), window.toggle_full_screen, "F11")
        self._add(menu, "view.log", tr("&Log"), window.show_log, "Ctrl+L", icon_name="log")

    def _build_tools(self) -> None:
        window = self._window
        menu = window.menuBar().addMenu(tr("&Tools"))
        self._add(menu, "tools.precision", tr("&Error against run time…"), window.show_precision)
        if "inspect" in window.entries:
            self._add(menu, "tools.stream", tr("&Stream the live depth…"), window.show_stream)
        self._add(menu, "tools.design", tr("&Design check…"), window.show_design)

    def _build_help(self) -> None:
        window = self._window
        menu = window.menuBar().addMenu(tr("&Help"))
        self._add(menu, "help.documentation", tr("&Documentation"), window.show_guide)
        shortcuts = tr("&Keyboard shortcuts")
        self._add(menu, "help.shortcuts", shortcuts, window.show_shortcuts, "F1", "?")
        boards = menu.addMenu(tr("&Printable checkerboards"))
        for square, use in ((3, tr("lens views")), (2, tr("top surface"))):
            text = tr("Squares of {s} mm ({use})").format(s=square, use=use)
            show = partial(window.open_board, square)
            self._add(boards, f"help.board_{square}mm", text, show)
        self._add(menu, "help.about", tr("&About"), window.show_about)

    def _add(
        self, menu: QMenu, name: str, text: str, slot: Callable[[], object], *keys: str,
        icon_name: str = "",
    ) -> None:  # fmt: skip
        action = make_action(self._window, name, text, slot, keys=keys, icon_name=icon_name)
        menu.addAction(action)

    def _build_themes(self) -> dict[str, QAction]:
        group = QActionGroup(self._window)
        actions = {}
        for key, label in THEMES.items():
            action = make_action(
                self._window, f"theme.{key}", label, lambda key=key: self._window.set_theme(key)
            )
            action.setCheckable(True)
            action.setChecked(key == self._window.context.settings.preferences.theme)
            group.addAction(action)
            actions[key] = action
        return actions
