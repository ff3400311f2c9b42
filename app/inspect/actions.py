"""Actions of the Inspect page: screenshots, profiles and references."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QObject
from PySide6.QtWidgets import QWidget

from app.live.live_depth import LiveDepth
from app.program.context import AppContext
from app.program.file_dialogs import ask_open, ask_save
from app.views.map.quantities import ReferenceMap
from app.views.surface.scene_export import ImageChoice, image_dialog
from app.widgets.actions import make_action
from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.measurement.map_processing import subtract_map
from gelpolight_core.output.formats import PROFILE_FORMATS
from gelpolight_core.output.heightmap_files import write_profile
from gelpolight_core.output.raster import read_npz

from .inspect_views import InspectViews


class FileActions(QObject):
    """The actions of the page that write an image or a table, or read a reference.

    Parameters
    ----------
    depth : LiveDepth
        Holds the open source and the current frame.
    views : InspectViews
        Source of the screenshots.
    owner : QWidget
        The page.
    context : AppContext
        Shared by all pages.
    """

    def __init__(
        self, depth: LiveDepth, views: InspectViews, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._depth, self._views = depth, views
        self._owner, self._context = owner, context
        text, tip = (
            "Screenshot…",
            "Save an image of the views or of the surface in any size",
        )
        key, name = ("Ctrl+Shift+P",), "inspect.screenshot"
        self.image_action = make_action(
            owner, name, text, self.screenshot, keys=key, icon_name="picture", tip=tip
        )
        text, tip = "Profile…", "Save the profile of the section line as a table (CSV)"
        name = "inspect.save_profile"
        self.profile_action = make_action(owner, name, text, self.save_profile, tip=tip)
        references = {
            "hold": "Use the current frame",
            "load": "Load from a file…",
            "clear": "Clear",
        }
        title, take = "Reference for differences", self.take_reference
        views.surface.menu.add_choices(title, "reference", references, take)

    # Profiles

    def save_profile(self) -> None:
        """Ask for a file, and write the profile of the section line as a table."""
        profile = self._views.section.cut.profile
        if profile is None:
            self._context.toasts.show("There is no profile yet.", "warn")
            return
        last = self._depth.last
        file = "profile-processed.csv" if last is not None and last.processed else "profile.csv"
        patterns = ";;".join(f"{f.title} (*{f.suffix})" for f in PROFILE_FORMATS.values())
        kind, title = ("table", patterns), "Save the profile"
        self._save(kind, title, file, partial(write_profile, profile))

    # The 3D view

    def take_reference(self, how: str) -> None:
        """Compare with the current frame (``hold``), a file (``load``) or nothing (``clear``)."""
        if how == "clear":
            self._views.compare_with(None)
        elif how == "load":
            settings, title = self._context.settings, "Load a reference"
            if path := ask_open(self._owner, settings, "height_map", title, "Height map (*.npz)"):
                self.load_reference(path)
        elif self.hold_reference():
            self._views.compare_with(self._views.processing.reference)

    def hold_reference(self) -> bool:
        """Keep the present height map, as reconstructed, as the reference. Return whether it is."""
        last = self._depth.last
        if last is None or last.raw is None:
            text = "There is no depth to use as a reference yet."
            self._context.toasts.show(text, "warn")
            return False
        name = f"frame {last.frame.number}"
        self._views.processing.show_reference(ReferenceMap(replace(last.raw, source=name), name))
        return True

    def load_reference(self, path: Path) -> None:
        """Compare with a height map that was exported as npz."""
        with self._context.toasts.errors():
            heightmap = read_npz(path)
            if self._depth.last is not None and self._depth.last.raw is not None:
                subtract_map(self._depth.last.raw, heightmap)
            self._views.compare_with(ReferenceMap(heightmap, path.name))

    # Screenshots

    def screenshot(self) -> None:
        """Ask which image to save and in which size."""
        kinds = ("views",) if self._views.surface.view is None else ("views", "surface")
        image_dialog(self._views.size(), kinds, self.save_screenshot, self._owner).open()

    def save_screenshot(self, choice: ImageChoice) -> None:
        """Ask for a file, and save all views or the surface in it."""
        if choice.what == "surface":
            self._views.surface.saving.ask_image_file(choice)
            return
        data = QByteArray()
        self._views.grab().toImage().save(QBuffer(data), b"PNG")
        name = f"inspect-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.png"
        kind, title = ("picture", "Image (*.png)"), "Save the image"
        write = partial(write_atomically, writer=lambda file: file.write(data.data()))
        self._save(kind, title, name, write)

    def _save(
        self, kind: tuple[str, str], title: str, name: str, write: Callable[[Path], object]
    ) -> None:
        """Ask for a file of a kind (folder and patterns), and write it."""
        folder, patterns = kind
        path = ask_save(self._owner, self._context.settings, folder, title, name, patterns)
        if path is not None:
            with self._context.toasts.errors():
                write(path)
                self._context.toasts.show(f"Saved to {path}")
