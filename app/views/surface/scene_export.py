"""The menu of the 3D view, and images of its surface: clipboard, PNG, and a turntable as GIF."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, fields
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from PIL import Image
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QGuiApplication
from PySide6.QtWidgets import QMenu, QProgressDialog, QWidget

from app.program.display import IN_3D, DisplaySettings, DisplayStore
from app.program.file_dialogs import ask_save
from app.program.settings import AppSettings
from app.widgets.actions import add_item
from app.widgets.dialog import Dialog
from app.widgets.forms import Form, form_dialog
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.form_fields import choice, number, switch

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


if TYPE_CHECKING:
    from .interactor import Interactor

ChoiceCallback = Callable[[Any], object]
TURN_FRAMES, TURN_MS, TURN_PX = 100, 8_000, 800
"""Frames of a turntable, its duration, and its longest side, for a file that fits into a mail."""


class SceneExport:
    """Handles the save and copy actions of the 3D view's menu.

    Parameters
    ----------
    parent : QWidget
        Parent of dialogs, in the size of the view.
    view : callable
        Returns the view, None until it is loaded.
    settings : AppSettings
        Store the last folder.
    report : callable
        Called with the result: a sentence and its kind.
    """

    def __init__(
        self,
        parent: QWidget,
        view: Callable[[], Interactor | None],
        *,
        settings: AppSettings,
        report: Callable[[str, str], object],
    ) -> None:
        self._parent, self.view, self._settings, self._report = parent, view, settings, report

    def copy(self) -> None:
        """Copy the view as on the screen to the clipboard."""
        if (view := self.view()) is not None:
            QGuiApplication.clipboard().setImage(view.grabFramebuffer())
            self._report("Image copied to the clipboard", "pass")

    def ask_image(self) -> None:
        """Ask for the size of an image, and save it."""
        image_dialog(self._parent.size(), ("surface",), self.ask_image_file, self._parent).open()

    def ask_image_file(self, choice: ImageChoice) -> None:
        """Ask for a file, and save an image of the surface in it."""
        if path := self._ask_path("png", "Save the image", "Image (*.png)"):
            self.save_image(path, choice)

    def save_image(self, path: Path, choice: ImageChoice) -> None:
        """Save an image of the surface, of any size."""
        from .scene import image_of  # with pyvista, which is loaded by now

        view = self.view()
        assert view is not None
        rgb = image_of(
            view.scene,
            (choice.width_px, choice.height_px),
            transparent=choice.transparent,
            paper=choice.paper,
        )
        image = Image.fromarray(np.asarray(rgb))
        self._write(path, lambda file: image.save(file, "PNG"))

    def ask_turntable(self) -> None:
        """Ask for a file, and save one turn of the surface in it."""
        if path := self._ask_path("gif", "Save the turntable", "GIF animation (*.gif)"):
            self.save_turntable(path)

    def save_turntable(self, path: Path) -> None:
        """Save one turn of the surface as an animation. It can be cancelled."""
        from .scene import OffscreenScene

        view = self.view()
        assert view is not None
        progress = QProgressDialog("Saving the turntable", "Cancel", 0, TURN_FRAMES, self._parent)
        set_names(progress, "view3d.turntable.progress", "Saving the turntable")
        progress.setWindowModality(Qt.WindowModality.WindowModal)
        progress.setMinimumDuration(0)
        frames: list[Image.Image] = []
        width_px, height_px = self._parent.width(), self._parent.height()
        scale = min(1.0, TURN_PX / max(width_px, height_px))
        size = round(scale * width_px), round(scale * height_px)
        with closing(OffscreenScene(view.scene, size)) as studio:
            while len(frames) < TURN_FRAMES and not progress.wasCanceled():
                rgb = Image.fromarray(studio.draw())
                frames.append(rgb.convert("P", palette=Image.Palette.ADAPTIVE))
                studio.turn(360.0 / TURN_FRAMES)
                progress.setValue(len(frames))  # also handles the events of the window
        if progress.wasCanceled():
            self._report("Saving the turntable was cancelled.", "warn")
        else:
            more: Any = {"append_images": frames[1:], "duration": TURN_MS / TURN_FRAMES, "loop": 0}
            self._write(path, lambda file: frames[0].save(file, "GIF", save_all=True, **more))
        progress.deleteLater()

    def _write(self, path: Path, write: Callable[[BinaryIO], object]) -> None:
        try:
            write_atomically(path, write)
        except InputError as error:
            self._report(str(error), "fail")
        else:
            self._report(f"Image saved to {path}", "pass")

    def _ask_path(self, ending: str, title: str, kinds: str) -> Path | None:
        name = f"surface-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.{ending}"
        return ask_save(self._parent, self._settings, "picture", title, name, kinds)


LARGEST_PX = 8000


def _in_3d(choice: ImageChoice) -> bool:
    """Whether the surface alone is saved, in any size."""
    return choice.what == "surface"


@dataclass(frozen=True, slots=True)
class ImageChoice:
    """Which image to save: the surface in any size, or all views, as shown on the screen."""

    what: str = choice(
        "surface",
        "Save",
        {"surface": "The surface in 3D", "views": "All views, as on the screen"},
    )
    width_px: int = number(800, "Width", 64, LARGEST_PX, " px", when=_in_3d)
    height_px: int = number(600, "Height", 64, LARGEST_PX, " px", when=_in_3d)
    transparent: bool = switch(False, "", "Transparent background", when=_in_3d)
    paper: bool = switch(False, "", "For print: white background, large letters", when=_in_3d)


def image_dialog(
    size: QSize, kinds: tuple[str, ...], chosen: ChoiceCallback, parent: QWidget
) -> Dialog:
    """Return a dialog that lets the user save one of some kinds of image, of twice a size."""
    value = ImageChoice(kinds[0], 2 * size.width(), 2 * size.height())
    form = Form(value, "view3d.image")
    form.show_row("what", len(kinds) > 1)
    return form_dialog(form, "view3d.image.dialog", "Save an image", chosen, parent)
