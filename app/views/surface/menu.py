"""The menu of the 3D view, for its button and for a right click."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu, QWidget

from app.program.display import IN_3D, DisplaySettings, DisplayStore
from app.widgets.actions import add_item
from gelpolight_core.base.arrays import PointXY

from .scene_export import SceneExport

DIRECTIONS = {
    "isometric": ("Isometric", "Ctrl+Shift+O"),
    "top": ("Top", "Ctrl+Shift+T"),
    "front": ("Front", "Ctrl+Shift+F"),
    "side": ("Side", "Ctrl+Shift+S"),
}
"""The label of each view direction, and its key."""


class SceneMenu(QMenu):
    """The menu of the 3D view.

    Parameters
    ----------
    parent : QWidget
        The panel of the view.
    display : DisplayStore
        Its settings.
    saving : SceneExport
        Saves the view.
    view_from, set_pins : callable
        Called with a view direction, and with the pins that are left.

    Attributes
    ----------
    pins_action : QAction
        Removes the pins.
    """

    def __init__(
        self,
        parent: QWidget,
        *,
        display: DisplayStore,
        saving: SceneExport,
        view_from: Callable[[str], object],
        set_pins: Callable[[tuple[PointXY, ...]], object],
    ) -> None:
        super().__init__(parent)
        self.setObjectName("view3d.options")
        self._display, self._saving = display, saving
        directions = self.addMenu("View from")
        for name, (text, keys) in DIRECTIONS.items():
            self.add(name, f"{text}\t{keys}", partial(view_from, name), directions)
        self._styles = {
            f.name: self.add(f"style_{f.name}", f.metadata["text"], partial(self._toggle, f.name))
            for f in fields(DisplaySettings)
            if f.name in IN_3D
        }
        self.clip_action = self.add("clip", "Clip by a plane", self._clip)
        for action in (*self._styles.values(), self.clip_action):
            action.setCheckable(True)
        self._of_pages = self.addSeparator()
        self.pins_action = self.add("pins_clear", "Remove pins", partial(set_pins, ()))
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
        for name, action in self._styles.items():
            action.setChecked(bool(getattr(self._display.value, name)))
        view = self._saving.view()
        for action in self._of_surface:
            action.setEnabled(view is not None and view.scene.surface is not None)

    def _toggle(self, name: str) -> None:
        self._display.change(**{name: self._styles[name].isChecked()})

    def _clip(self) -> None:
        if (view := self._saving.view()) is not None:
            view.show_plane(self.clip_action.isChecked())
