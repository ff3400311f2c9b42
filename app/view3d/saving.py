"""From the 3D view to the clipboard, image files and movies."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np
from PIL import Image
from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QFileDialog, QWidget

from app.services.settings import Settings
from app.view3d.image_dialog import ImageChoice, ImageDialog, MovieChoice, MovieDialog
from app.view3d.panel import SurfacePanel
from app.view3d.surface import Surface
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.translation import tr

# Plays the recording of a page for a movie: gets a function that takes each surface until it
# returns False. Returns the number of frames.
Player = Callable[[Callable[[Surface | None], bool]], int]


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
        Returns a Player while a recording is open, else None.

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
        player: Callable[[], Player | None] = lambda: None,
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
        dialog = ImageDialog(self._panel.size(), ("surface",), parent=self._owner)
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
        rgb = image_of(self._panel.view.scene, choice.size, transparent=choice.transparent)
        try:
            write_atomically(path, lambda file: Image.fromarray(np.asarray(rgb)).save(file, "PNG"))
        except InputError as error:
            self.reported.emit(str(error), "fail")
        else:
            self.reported.emit(tr("Image saved to {path}").format(path=path), "pass")

    def ask_movie(self) -> None:
        """Ask for the kind and size of a movie, and save it."""
        recording = self._player() is not None
        dialog = MovieDialog(self._panel.size(), recording=recording, parent=self._owner)
        dialog.chosen.connect(self.ask_movie_file)
        dialog.open()

    def ask_movie_file(self, choice: MovieChoice) -> None:
        """Ask for a file, and save a movie in it."""
        kinds = tr("MP4 movie (*.mp4);;GIF animation (*.gif)")
        if path := self._ask_path("mp4", tr("Save the movie"), kinds):
            self.save_movie(path, choice)

    def save_movie(self, path: Path, choice: MovieChoice) -> None:
        """Save a movie, frame by frame."""
        from app.view3d.images import Studio
        from app.view3d.movie import MovieMaker, SurfaceFeed, frame_by_frame, turntable

        assert self._panel.view is not None
        if path.suffix.lower() not in (".mp4", ".gif"):
            path = path.with_suffix(".mp4")
        feed, player = SurfaceFeed(), self._player()
        if choice.what == "recording" and player is not None:
            count, steps = player(feed.put), frame_by_frame(feed)
        else:
            count = max(round(choice.rate_hz * choice.seconds), 2)
            steps = turntable(count)
        studio = Studio(self._panel.view.scene, choice.size)
        maker = MovieMaker(studio, path, choice.rate_hz, steps, count, parent=self._owner)
        maker.ended.connect(feed.ended.set)
        maker.ended.connect(self.reported)

    def _ask_path(self, ending: str, title: str, kinds: str) -> Path | None:
        name = f"surface-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.{ending}"
        proposed = str(self._settings.folder("picture") / name)
        chosen, _ = QFileDialog.getSaveFileName(self._owner, title, proposed, kinds)
        if not chosen:
            return None
        self._settings.keep_folder("picture", Path(chosen).parent)
        return Path(chosen)
