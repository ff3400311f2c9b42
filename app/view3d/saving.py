"""From the 3D view to the clipboard, image files and movies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from PySide6.QtCore import QObject, QSize, Qt, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialogButtonBox, QProgressDialog, QWidget

from app.services.file_dialogs import ask_save
from app.services.settings import Settings
from app.view3d.panel import SurfacePanel
from app.view3d.surface import Surface
from app.widgets.dialog import Dialog
from app.widgets.fields import choice, number, switch
from app.widgets.forms import Form
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.translation import tr

# The recording of a page for a movie: the number of its frames, and their surfaces.
Played = tuple[int, Iterator[Surface]]


class ViewSaving(QObject):
    """Handles the save and copy actions of the 3D view's menu.

    Parameters
    ----------
    panel : SurfacePanel
        Contains the view.
    owner : QWidget
        Parent of dialogs.
    settings : Settings
        Store the last folder.
    player : callable, optional
        Returns the frames of the open recording, or None.

    Signals
    -------
    reported(str, str)
        The result, as a sentence and its kind.
    """

    reported = Signal(str, str)

    def __init__(
        self,
        panel: SurfacePanel,
        owner: QWidget,
        *,
        settings: Settings,
        player: Callable[[], Played | None] = lambda: None,
    ) -> None:
        super().__init__(owner)
        self._panel, self._owner, self._settings, self._player = panel, owner, settings, player
        panel.menu.copy_wanted.connect(self.copy)
        panel.menu.image_wanted.connect(self.ask_image)
        panel.menu.movie_wanted.connect(self.ask_movie)

    def copy(self) -> None:
        """Copy the view as on the screen to the clipboard."""
        QGuiApplication.clipboard().setImage(self._panel.image())
        self.reported.emit(tr("Image copied to the clipboard"), "pass")

    def ask_image(self) -> None:
        """Ask for the size of an image, and save it."""
        dialog = image_dialog(self._panel.size(), ("surface",), self._owner)
        dialog.chosen.connect(self.ask_image_file)
        dialog.open()

    def ask_image_file(self, choice: ImageChoice) -> None:
        """Ask for a file, and save an image of the surface in it."""
        if path := self._ask_path("png", tr("Save the image"), tr("Image (*.png)")):
            self.save_image(path, choice)

    def save_image(self, path: Path, choice: ImageChoice) -> None:
        """Save an image of the surface, of any size."""
        from app.view3d.images import image_of  # with pyvista, which is loaded by now

        assert self._panel.view is not None
        rgb = image_of(
            self._panel.view.scene,
            (choice.width_px, choice.height_px),
            transparent=choice.transparent,
        )
        try:
            write_atomically(path, lambda file: Image.fromarray(np.asarray(rgb)).save(file, "PNG"))
        except InputError as error:
            self.reported.emit(str(error), "fail")
        else:
            self.reported.emit(tr("Image saved to {path}").format(path=path), "pass")

    def ask_movie(self) -> None:
        """Ask for the kind and size of a movie, and save it."""
        recording = self._player() is not None
        dialog = movie_dialog(self._panel.size(), recording=recording, parent=self._owner)
        dialog.chosen.connect(self.ask_movie_file)
        dialog.open()

    def ask_movie_file(self, choice: MovieChoice) -> None:
        """Ask for a file, and save a movie in it."""
        kinds = tr("MP4 movie (*.mp4);;GIF animation (*.gif)")
        if path := self._ask_path("mp4", tr("Save the movie"), kinds):
            self.save_movie(path, choice)

    def save_movie(self, path: Path, choice: MovieChoice) -> None:
        """Save a movie, frame by frame. It can be cancelled."""
        from app.view3d.images import (
            MovieCancelled,
            playback,
            studio,
            turntable,
            watched,
            write_movie,
        )

        assert self._panel.view is not None
        if path.suffix.lower() not in (".mp4", ".gif"):
            path = path.with_suffix(".mp4")
        count = max(round(choice.rate_hz * choice.seconds), 2)
        played = self._player() if choice.what == "recording" else None
        progress = QProgressDialog(tr("Saving the movie"), tr("Cancel"), 0, count, self._owner)
        named(progress, "view3d.movie.progress", tr("Saving the movie"))
        progress.setWindowModality(Qt.WindowModality.WindowModal)
        progress.setMinimumDuration(0)
        size = choice.width_px, choice.height_px
        with studio(self._panel.view.scene, size) as opened:
            images = turntable(opened, count)
            if played is not None:
                progress.setMaximum(played[0])
                images = playback(opened, played[1])
            try:
                done = write_movie(path, choice.rate_hz, watched(images, progress))
            except InputError as error:
                self.reported.emit(str(error), "fail")
            except MovieCancelled:
                self.reported.emit(tr("Saving the movie was cancelled."), "warn")
            else:
                text = tr("Movie of {n} frames saved to {path}")
                self.reported.emit(text.format(n=done, path=path), "pass")
            finally:
                progress.deleteLater()

    def _ask_path(self, ending: str, title: str, kinds: str) -> Path | None:
        name = f"surface-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.{ending}"
        return ask_save(self._owner, self._settings, "picture", title, name, kinds)


LARGEST_PX = 8000
LARGEST_MOVIE_PX = 3840


@dataclass(frozen=True, slots=True)
class ImageChoice:
    """Which image to save: the surface in any size, or all views, as shown on the screen."""

    what: str = choice(
        "surface",
        tr("Save"),
        {"surface": tr("The surface in 3D"), "views": tr("All views, as on the screen")},
    )
    width_px: int = number(
        800, tr("Width"), 64, LARGEST_PX, tr(" px"), when=lambda c: c.what == "surface"
    )
    height_px: int = number(
        600, tr("Height"), 64, LARGEST_PX, tr(" px"), when=lambda c: c.what == "surface"
    )
    transparent: bool = switch(
        False, "", tr("Transparent background"), when=lambda c: c.what == "surface"
    )


@dataclass(frozen=True, slots=True)
class MovieChoice:
    """Which movie to save: one turn of the surface, or the open recording."""

    what: str = choice(
        "turntable",
        tr("Save"),
        {
            "turntable": tr("Turntable: one full turn of the surface"),
            "recording": tr("The recording, frame by frame"),
        },
    )
    width_px: int = number(800, tr("Width"), 64, LARGEST_MOVIE_PX, tr(" px"))
    height_px: int = number(600, tr("Height"), 64, LARGEST_MOVIE_PX, tr(" px"))
    rate_hz: float = number(15.0, tr("Frames per second"), 1.0, 60.0)
    seconds: float = number(
        8.0,
        tr("Duration of one turn"),
        1.0,
        120.0,
        tr(" s"),
        when=lambda c: c.what == "turntable",
    )


class ChoiceDialog(Dialog):
    """Lets the user choose what to save.

    Parameters
    ----------
    value : ImageChoice or MovieChoice
        Proposed.
    only : bool
        Whether there is nothing else to save than what is proposed.

    Signals
    -------
    chosen(object)
        The choice.
    """

    chosen = Signal(object)

    def __init__(self, name: str, title: str, value: Any, *, only: bool, parent: QWidget) -> None:
        kinds = QDialogButtonBox.StandardButton
        super().__init__(
            parent, f"view3d.{name}.dialog", title, kinds.Save | kinds.Cancel, once=True
        )
        form = Form(value, f"view3d.{name}")
        form.show_row("what", not only)
        self.fill(form)
        self.accepted.connect(lambda: self.chosen.emit(form.value))


def image_dialog(size: QSize, kinds: tuple[str, ...], parent: QWidget) -> ChoiceDialog:
    """Return a dialog that lets the user save one of some kinds of image, of twice a size."""
    value = ImageChoice(kinds[0], 2 * size.width(), 2 * size.height())
    return ChoiceDialog("image", tr("Save an image"), value, only=len(kinds) == 1, parent=parent)


def movie_dialog(size: QSize, *, recording: bool, parent: QWidget) -> ChoiceDialog:
    """Return a dialog that lets the user save a movie of a size."""
    value = MovieChoice("turntable", size.width(), size.height())
    return ChoiceDialog("movie", tr("Save a movie"), value, only=not recording, parent=parent)
