"""The menu of the 3D view, for its button and for a right click."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu

from app.view3d.style import Style
from app.widgets.actions import add_item

if TYPE_CHECKING:
    from app.view3d.panel import SurfacePanel

DIRECTIONS = {
    "isometric": ("Isometric", "Ctrl+Shift+O"),
    "top": ("Top", "Ctrl+Shift+T"),
    "front": ("Front", "Ctrl+Shift+F"),
    "side": ("Side", "Ctrl+Shift+S"),
}
"""The label of each view direction, and its key."""


STYLES = {f.name: f.metadata["text"] for f in fields(Style) if f.metadata}
"""The label of each part of a style that can be switched."""


class ViewMenu(QMenu):
    """The menu of the 3D view.

    Parameters
    ----------
    panel : SurfacePanel
        The panel that it controls.
    """

    def __init__(self, panel: SurfacePanel) -> None:
        super().__init__(panel)
        self.setObjectName("view3d.options")
        self._panel = panel
        saving = panel.saving
        directions = self.addMenu("View from")
        for name, (text, keys) in DIRECTIONS.items():
            self.add(name, f"{text}\t{keys}", partial(panel.view_from, name), directions)
        self._styles = {
            name: self.add(f"style_{name}", text, partial(self._toggle, name))
            for name, text in STYLES.items()
        }
        self.clip_action = self.add("clip", "Clip by a plane", self._clip)
        for action in (*self._styles.values(), self.clip_action):
            action.setCheckable(True)
        self._of_pages = self.addSeparator()
        self._pins_clear = self.add("pins_clear", "Remove pins", partial(panel.set_pins, ()))
        self.addSeparator()
        self._of_surface = [
            self.clip_action,
            self.add("copy", "Copy image", saving.copy),
            self.add("image", "Save image…", saving.ask_image),
            self.add("turntable", "Save turntable…", saving.ask_turntable),
        ]
        self.aboutToShow.connect(self._follow)

    def add(
        self, name: str, text: str, slot: Callable[[], object], menu: QMenu | None = None
    ) -> QAction:
        """Add an entry, to this menu or to one within it."""
        return add_item(menu or self, f"view3d.{name}", text, slot)

    def add_choices(
        self,
        title: str,
        name: str,
        choices: Mapping[str, str],
        slot: Callable[[str], object],
        chosen: str = "",
    ) -> None:
        """Add a menu whose entries call `slot` with their keys, with a mark if one is `chosen`."""
        menu = QMenu(title, self)
        self.insertMenu(self._of_pages, menu)
        group = QActionGroup(self)
        for key, text in choices.items():
            action = self.add(f"{name}_{key}", text, partial(slot, key), menu)
            if chosen:
                action.setCheckable(True)
                action.setChecked(key == chosen)
                group.addAction(action)

    def _follow(self) -> None:
        """Update the check marks, and enable what can be used now."""
        style, view = self._panel.view_style, self._panel.view
        for name, action in self._styles.items():
            action.setChecked(bool(getattr(style, name)))
        for action in self._of_surface:
            action.setEnabled(view is not None and view.scene.surface is not None)
        self._pins_clear.setEnabled(bool(self._panel.pins))

    def _toggle(self, name: str) -> None:
        changed: Any = {name: self._styles[name].isChecked()}
        self._panel.set_style(replace(self._panel.view_style, **changed))

    def _clip(self) -> None:
        if self._panel.view is not None:
            self._panel.view.show_plane(self.clip_action.isChecked())
