"""The menu of the 3D view, for its button and for a right click."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QInputDialog, QMenu

from app.services.settings import Settings
from app.view3d.style import Style, viewpoints_as_text, viewpoints_from_text
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from app.view3d.panel import SurfacePanel

VIEWPOINTS = "viewpoints"
DIRECTIONS = {
    "isometric": (tr("Isometric"), "Ctrl+Shift+O"),
    "top": (tr("Top"), "Ctrl+Shift+T"),
    "front": (tr("Front"), "Ctrl+Shift+F"),
    "side": (tr("Side"), "Ctrl+Shift+S"),
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
    settings : Settings
        Store saved viewpoints.

    Signals
    -------
    colour_chosen(str)
        Another quantity was selected for the colours.
    reference_wanted(str)
        ``hold``, ``load`` or ``clear`` the reference of the difference.
    copy_wanted(), image_wanted(), movie_wanted(), mesh_wanted()
        Copy the image, or save an image, a movie, or the mesh.
    """

    colour_chosen = Signal(str)
    reference_wanted = Signal(str)
    copy_wanted = Signal()
    image_wanted = Signal()
    movie_wanted = Signal()
    mesh_wanted = Signal()

    def __init__(self, panel: SurfacePanel, *, settings: Settings) -> None:
        super().__init__(panel)
        self.setObjectName("view3d.options")
        self._panel, self._settings = panel, settings
        directions = self.addMenu(tr("View from"))
        for name, (text, keys) in DIRECTIONS.items():
            self._add(name, f"{text}\t{keys}", partial(panel.view_from, name), directions)
        for name, text in STYLES.items():
            action = self._add(f"style_{name}", text, None)
            action.setCheckable(True)
            action.triggered.connect(partial(self._set, name))
        self.clip_action = self._add("clip", tr("Clip by a plane"), None)
        self.clip_action.setCheckable(True)
        self.clip_action.triggered.connect(self._clip)
        self.addSeparator()
        self._colours = self.addMenu(tr("Colour by"))
        self._group = QActionGroup(self)
        self._reference = self.addMenu(tr("Reference for differences"))
        for name, text in (
            ("hold", tr("Use the current frame")),
            ("load", tr("Load from a file…")),
            ("clear", tr("Clear")),
        ):
            self._add(
                f"reference_{name}", text, partial(self.reference_wanted.emit, name),
                self._reference,
            )  # fmt: skip
        self._viewpoints = self.addMenu(tr("Viewpoints"))
        self._viewpoints.aboutToShow.connect(self._list_viewpoints)
        self._add("pins_clear", tr("Remove pins"), partial(panel.set_pins, ()))
        self.addSeparator()
        for name, text, signal in (
            ("copy", tr("Copy image"), self.copy_wanted),
            ("image", tr("Save image…"), self.image_wanted),
            ("movie", tr("Save movie…"), self.movie_wanted),
            ("mesh", tr("Export mesh…"), self.mesh_wanted),
        ):
            self._add(name, text, signal.emit)
        self._action("mesh").setVisible(False)
        self.set_colours({}, "")
        self.aboutToShow.connect(self._follow)

    def offer_mesh(self) -> None:
        """Offer differences and the export of the mesh, which the page handles."""
        self._action("mesh").setVisible(True)
        self._reference.menuAction().setVisible(True)

    def _add(
        self, name: str, text: str, slot: Callable[[], object] | None, menu: QMenu | None = None
    ) -> QAction:
        action = (menu or self).addAction(text)
        action.setObjectName(f"view3d.{name}")
        if slot is not None:
            action.triggered.connect(lambda _on=False: slot())
        return action

    def set_colours(self, names: dict[str, str], chosen: str) -> None:
        """Offer these quantities for the colours."""
        self._colours.clear()
        for action in self._group.actions():
            self._group.removeAction(action)
        for key, text in names.items():
            action = self._add(
                f"colour_{key}", text, partial(self.colour_chosen.emit, key),
                self._colours,
            )  # fmt: skip
            action.setCheckable(True)
            action.setChecked(key == chosen)
            self._group.addAction(action)
        self._colours.menuAction().setVisible(bool(names))
        self._reference.menuAction().setVisible("difference" in names)

    def _follow(self) -> None:
        """Update the check marks, and enable what can be used now."""
        style = self._panel.view_style
        for name in STYLES:
            self._action(f"style_{name}").setChecked(bool(getattr(style, name)))
        there = self._panel.view is not None and self._panel.view.scene.surface is not None
        for name in ("clip", "copy", "image", "movie", "mesh"):
            self._action(name).setEnabled(there)
        self._action("pins_clear").setEnabled(bool(self._panel.pins))

    def _action(self, name: str) -> QAction:
        found = self.findChild(QAction, f"view3d.{name}")
        assert isinstance(found, QAction)
        return found

    def _set(self, name: str, on: bool) -> None:
        style: Style = replace(self._panel.view_style, **{name: on})
        self._panel.set_style(style)

    def _clip(self, on: bool) -> None:
        if self._panel.view is not None:
            self._panel.view.show_plane(on)

    # Viewpoints

    def _list_viewpoints(self) -> None:
        menu, saved = self._viewpoints, viewpoints_from_text(self._settings.display(VIEWPOINTS))
        menu.clear()
        self._add("viewpoint_save", tr("Save this viewpoint…"), self._ask_name, menu)
        for name in saved:
            self._add("viewpoint", name, partial(self.go_to, name), menu)
        if saved:
            menu.addSeparator()
            self._add(
                "viewpoint_clear", tr("Remove all viewpoints"),
                partial(self._settings.keep_display, VIEWPOINTS, ""), menu,
            )  # fmt: skip

    def _ask_name(self) -> None:
        dialog = QInputDialog(self._panel)
        dialog.setWindowTitle(tr("Save this viewpoint"))
        dialog.setLabelText(tr("Name"))
        dialog.textValueSelected.connect(self.save_viewpoint)
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

    def save_viewpoint(self, name: str) -> None:
        """Save the camera under a name."""
        if self._panel.view is None or not name.strip():
            return
        saved = viewpoints_from_text(self._settings.display(VIEWPOINTS))
        saved[name.strip()] = self._panel.view.scene.viewpoint
        self._settings.keep_display(VIEWPOINTS, viewpoints_as_text(saved))

    def go_to(self, name: str) -> None:
        """View from a saved viewpoint."""
        saved = viewpoints_from_text(self._settings.display(VIEWPOINTS))
        if self._panel.view is None or name not in saved:
            return
        self._panel.view.scene.viewpoint = saved[name]
        self._panel.set_style(replace(self._panel.view_style, parallel=saved[name].parallel))
