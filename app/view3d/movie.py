"""Makes a movie frame by frame between other events, so that the window stays usable."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QProgressBar,
    QVBoxLayout,
    QWidget,
)

from app.view3d.images import MovieWriter, Studio
from app.view3d.surface import Surface
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

Step = Callable[[Studio], None]
WAIT_MS = 20


def turntable(frames: int) -> Iterator[Step]:
    """Return the steps of one whole turn."""
    for number in range(frames):
        yield lambda studio, first=number == 0: None if first else studio.turn(360.0 / frames)


def frame_by_frame(feed: SurfaceFeed) -> Iterator[Step | None]:
    """Return a step for each surface of a feed, or None while the next one is not ready."""
    while True:
        try:
            surface = feed.surfaces.get_nowait()
        except queue.Empty:
            yield None
            continue
        if surface is None:
            return
        yield lambda studio, surface=surface: studio.scene.show_surface(surface)


class SurfaceFeed:
    """Passes surfaces from the thread that makes them to the movie."""

    def __init__(self) -> None:
        self.surfaces: queue.Queue[Surface | None] = queue.Queue(maxsize=2)
        self.ended = threading.Event()

    def put(self, surface: Surface | None) -> bool:
        """Pass on the next surface, None for the end. Return False if they are no longer needed."""
        while not self.ended.is_set():
            try:
                self.surfaces.put(surface, timeout=0.1)
            except queue.Full:
                continue
            return True
        return False


class ProgressDialog(QDialog):
    """Shows the progress of a movie, and cancels it.

    Parameters
    ----------
    count : int
        Frames of the movie.
    parent : QWidget
        Owner.
    """

    def __init__(self, count: int, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, "view3d.movie.progress", tr("Saving the movie"))
        self.setWindowTitle(tr("Saving the movie"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.bar = named(QProgressBar(), "view3d.movie.bar", tr("Frames saved"))
        self.bar.setRange(0, count)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addWidget(self.bar)
        column.addWidget(buttons)


class MovieMaker(QObject):
    """Draws and writes one frame whenever the window is idle.

    Parameters
    ----------
    studio : Studio
        Draws the frames. Closed at the end.
    path : Path
        The file: complete at the end, or not created.
    rate_hz : float
        Frames per second.
    steps : iterator
        The change for each frame. None: wait.
    count : int
        Number of frames.
    parent : QWidget
        Owner of the progress dialog.

    Signals
    -------
    ended(str, str)
        The result, as a sentence and its kind: ``pass``, ``warn`` or ``fail``.
    """

    ended = Signal(str, str)

    def __init__(
        self, studio: Studio, path: Path, rate_hz: float, steps: Iterator[Step | None],
        count: int, *, parent: QWidget,
    ) -> None:  # fmt: skip
        super().__init__(parent)
        self._studio, self._path, self._steps = studio, path, steps
        self._writer = MovieWriter(path, rate_hz)
        self._done = 0
        self._progress = ProgressDialog(count, parent)
        self._progress.rejected.connect(self.cancel)
        self._progress.open()
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._draw_next)
        self._timer.start(0)

    def cancel(self) -> None:
        """Stop, and delete the unfinished file."""
        if self._timer.isActive():
            self._writer.cancel()
            self._end(tr("Saving the movie was cancelled."), "warn")

    def _draw_next(self) -> None:
        try:
            step = next(self._steps)
        except StopIteration:
            self._finish()
            return
        self._timer.setInterval(WAIT_MS if step is None else 0)
        if step is None:
            return
        try:
            step(self._studio)
            self._writer.add(self._studio.draw())
        except InputError as error:
            self._end(str(error), "fail")
            return
        self._done += 1
        self._progress.bar.setValue(self._done)

    def _finish(self) -> None:
        try:
            self._writer.finish()
        except InputError as error:
            self._end(str(error), "fail")
        else:
            words = tr("Movie of {n} frames saved to {path}")
            self._end(words.format(n=self._done, path=self._path), "pass")

    def _end(self, sentence: str, kind: str) -> None:
        self._timer.stop()
        self._studio.close()
        self._progress.rejected.disconnect()
        self._progress.accept()
        self.ended.emit(sentence, kind)
        self.deleteLater()
