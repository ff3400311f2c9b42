"""The menus of the main window."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtGui import QAction, QActionGroup

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
        themes = menu.addMenu(tr("&Theme"))
        themes.addActions(list(self.themes.values()))
        menu.addAction(
            make_action(
                window,
                "view.fullscreen",
                tr("&Full screen"),
                window.toggle_full_screen,
                keys=("F11",),
            )
        )
        menu.addAction(
            make_action(
                window, "view.log", tr("&Log"), window.show_log, keys=("Ctrl+L",), icon_name="log"
            )
        )

    def _build_tools(self) -> None:
        window = self._window
        menu = window.menuBar().addMenu(tr("&Tools"))
        menu.addAction(
            make_action(
                window,
                "tools.precision",
                tr("&Error against run time…"),
                window.show_precision,
            )
        )
        menu.addAction(
            make_action(
                window, "tools.stability", tr("Numerical &stability…"), window.show_stability
            )
        )
        if "inspect" in window.entries:
            menu.addAction(
                make_action(
                    window, "tools.stream", tr("&Stream the live depth…"), window.show_stream
                )
            )
        menu.addAction(
            make_action(window, "tools.design", tr("&Design check…"), window.show_design)
        )

    def _build_help(self) -> None:
        window = self._window
        menu = window.menuBar().addMenu(tr("&Help"))
        menu.addAction(
            make_action(window, "help.documentation", tr("&Documentation"), window.show_guide)
        )
        menu.addAction(
            make_action(
                window,
                "help.shortcuts",
                tr("&Keyboard shortcuts"),
                window.show_shortcuts,
                keys=("F1", "?"),
            )
        )
        boards = menu.addMenu(tr("&Printable checkerboards"))
        for square, use in ((3, tr("lens views")), (2, tr("top surface"))):
            boards.addAction(
                make_action(
                    window,
                    f"help.board_{square}mm",
                    tr("Squares of {s} mm ({use})").format(s=square, use=use),
                    lambda square=square: window.open_board(square),
                )
            )
        menu.addAction(make_action(window, "help.about", tr("&About"), window.show_about))

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
