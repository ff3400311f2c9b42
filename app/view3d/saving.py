"""From the 3D view to the clipboard, image files and movies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QProgressDialog, QWidget

from app.services.file_dialogs import ask_save
from app.services.settings import Settings
from app.view3d.surface import Surface
from app.widgets.dialog import Dialog
from app.widgets.forms import Form, form_dialog
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.fields import choice, number, switch
from gelpolight_core.io.atomic import write_atomically

if TYPE_CHECKING:
    from app.view3d.panel import SurfacePanel

# The recording of a page for a movie: the number of its frames, and their surfaces.
Played = tuple[int, Iterator[Surface]]
Chosen = Callable[[Any], object]


class ViewSaving:
    """Handles the save and copy actions of the 3D view's menu.

    Parameters
    ----------
    panel : SurfacePanel
        Contains the view, and is the parent of dialogs.
    settings : Settings
        Store the last folder.
    report : callable
        Called with the result: a sentence and its kind.
    player : callable
        Returns the frames of the open recording, or None.
    """

    def __init__(
        self,
        panel: SurfacePanel,
        *,
        settings: Settings,
        report: Callable[[str, str], object],
        player: Callable[[], Played | None],
    ) -> None:
        self._panel, self._settings, self._player = panel, settings, player
        self._report = report

    def copy(self) -> None:
        """Copy the view as on the screen to the clipboard."""
        QGuiApplication.clipboard().setImage(self._panel.image())
        self._report("Image copied to the clipboard", "pass")

    def ask_image(self) -> None:
        """Ask for the size of an image, and save it."""
        image_dialog(self._panel.size(), ("surface",), self.ask_image_file, self._panel).open()

    def ask_image_file(self, choice: ImageChoice) -> None:
        """Ask for a file, and save an image of the surface in it."""
        if path := self._ask_path("png", "Save the image", "Image (*.png)"):
            self.save_image(path, choice)

    def save_image(self, path: Path, choice: ImageChoice) -> None:
        """Save an image of the surface, of any size."""
        from app.view3d.images import image_of  # with pyvista, which is loaded by now

        assert self._panel.view is not None
        rgb = image_of(
            self._panel.view.scene,
            (choice.width_px, choice.height_px),
            transparent=choice.transparent,
            paper=choice.paper,
        )
        try:
            write_atomically(path, lambda file: Image.fromarray(np.asarray(rgb)).save(file, "PNG"))
        except InputError as error:
            self._report(str(error), "fail")
        else:
            self._report(f"Image saved to {path}", "pass")

    def ask_movie(self) -> None:
        """Ask for the kind and size of a movie, and save it."""
        recording = self._player() is not None
        size = self._panel.size()
        movie_dialog(size, self.ask_movie_file, recording=recording, parent=self._panel).open()

    def ask_movie_file(self, choice: MovieChoice) -> None:
        """Ask for a file, and save a movie in it."""
        kinds = "MP4 movie (*.mp4);;GIF animation (*.gif)"
        if path := self._ask_path("mp4", "Save the movie", kinds):
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
        progress = QProgressDialog("Saving the movie", "Cancel", 0, count, self._panel)
        named(progress, "view3d.movie.progress", "Saving the movie")
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
                self._report(str(error), "fail")
            except MovieCancelled:
                self._report("Saving the movie was cancelled.", "warn")
            else:
                text = "Movie of {n} frames saved to {path}"
                self._report(text.format(n=done, path=path), "pass")
            finally:
                progress.deleteLater()

    def _ask_path(self, ending: str, title: str, kinds: str) -> Path | None:
        name = f"surface-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.{ending}"
        return ask_save(self._panel, self._settings, "picture", title, name, kinds)


LARGEST_PX = 8000
LARGEST_MOVIE_PX = 3840


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


@dataclass(frozen=True, slots=True)
class MovieChoice:
    """Which movie to save: one turn of the surface, or the open recording."""

    what: str = choice(
        "turntable",
        "Save",
        {
            "turntable": "Turntable: one full turn of the surface",
            "recording": "The recording, frame by frame",
        },
    )
    width_px: int = number(800, "Width", 64, LARGEST_MOVIE_PX, " px")
    height_px: int = number(600, "Height", 64, LARGEST_MOVIE_PX, " px")
    rate_hz: float = number(15.0, "Frames per second", 1.0, 60.0)
    seconds: float = number(
        8.0, "Duration of one turn", 1.0, 120.0, " s", when=lambda c: c.what == "turntable"
    )


def image_dialog(size: QSize, kinds: tuple[str, ...], chosen: Chosen, parent: QWidget) -> Dialog:
    """Return a dialog that lets the user save one of some kinds of image, of twice a size."""
    value = ImageChoice(kinds[0], 2 * size.width(), 2 * size.height())
    form = Form(value, "view3d.image")
    form.show_row("what", len(kinds) > 1)
    return form_dialog(form, "view3d.image.dialog", "Save an image", chosen, parent)


def movie_dialog(size: QSize, chosen: Chosen, *, recording: bool, parent: QWidget) -> Dialog:
    """Return a dialog that lets the user save a movie of a size."""
    form = Form(MovieChoice("turntable", size.width(), size.height()), "view3d.movie")
    form.show_row("what", recording)
    return form_dialog(form, "view3d.movie.dialog", "Save a movie", chosen, parent)
