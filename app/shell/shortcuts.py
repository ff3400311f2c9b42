"""The sheet of keyboard shortcuts, built from the actions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QScrollArea, QWidget

from app.widgets.dialog import Dialog
from app.widgets.label import MarkupLabel, escaped, key_text
from app.widgets.naming import named
from app.widgets.qt_tree import below

# Titles of groups whose internal name differs from the name in the user interface.
TITLES = {"lut": "Reflectance curves", "live": "Live image", "navigation": "Pages"}
# As a share of the window's height.
TALL = 0.8


@dataclass(frozen=True, slots=True)
class Shortcut:
    """One line of the sheet."""

    group: str
    keys: str
    text: str


def shortcuts_of(window: QWidget) -> tuple[Shortcut, ...]:
    """Return the shortcuts of a window that can be used, in the order of their groups.

    They come from named actions. The group is the first part of the object name
    (``sensors.import``).
    """
    found = []
    for action in below(window, QAction):
        keys = ", ".join(map(key_text, action.shortcuts()))
        if keys and action.objectName() and action.isEnabled():
            group = action.objectName().partition(".")[0]
            found.append(Shortcut(group, keys, action.text().replace("&", "").rstrip(".… ")))
    return tuple(sorted(dict.fromkeys(found), key=lambda s: s.group))


class ShortcutSheet(Dialog):
    """All shortcuts of the window in its current state."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window, "shortcuts", "Keyboard shortcuts", once=True)
        self.shortcuts = shortcuts_of(window)
        rows = []
        for group, shortcuts in groupby(self.shortcuts, lambda shortcut: shortcut.group):
            title = TITLES.get(group, group.capitalize())
            rows.append(f"<tr><td colspan=2><h4>{escaped(title)}</h4></td></tr>")
            rows += [
                f"<tr><td><b>{escaped(shortcut.keys)}</b>&nbsp;&nbsp;&nbsp;</td>"
                f"<td>{escaped(shortcut.text)}</td></tr>"
                for shortcut in shortcuts
            ]
        text = MarkupLabel(f"<table cellpadding=2>{''.join(rows)}</table>")
        sheet = named(text, "shortcuts.table", "Shortcuts")
        sheet.setAlignment(Qt.AlignmentFlag.AlignTop)
        sheet.setMargin(8)
        area = QScrollArea()
        area.setWidget(sheet)
        area.setWidgetResizable(True)
        self.fill(area)
        self.resize(420, max(520, round(TALL * window.height())))
