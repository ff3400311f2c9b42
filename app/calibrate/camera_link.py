"""The camera of the wizard: opened while the page is shown, watched, and opened again when lost."""

from __future__ import annotations

from PySide6.QtCore import QObject, QTimer, Signal

from app.calibrate.watching import Watching
from app.shell.context import AppContext
from app.sources.stream import Stream
from gelpolight_core.translation import tr

STATUS_MS = 500


class CameraLink(QObject):
    """Keeps the chosen source's stream while the page is shown.

    Signals
    -------
    switched()
        There is another stream, or none.
    lost(str)
        Why no more pictures come; empty when they do.
    """

    switched = Signal()
    lost = Signal(str)

    def __init__(self, watching: Watching, *, context: AppContext, parent: QObject) -> None:
        super().__init__(parent)
        self._watching, self._context = watching, context
        self._why = ""
        self._wanted = self._shown = False
        self._tick = QTimer(self)
        self._tick.setInterval(STATUS_MS)
        self._tick.timeout.connect(self._look)

    @property
    def stream(self) -> Stream | None:
        """Where frames come from; None where no camera is chosen."""
        return self._watching.stream

    def use(self, wanted: bool) -> None:
        """Take pictures, or none where nobody looks: they would slow the computation down."""
        if wanted != self._wanted:
            self._wanted = wanted
            self.open()

    def open(self) -> None:
        """Take pictures of the chosen source from now on, where they are wanted."""
        self.close()
        info = self._context.source.info
        if info is not None and self._wanted and self._shown:
            stream = Stream(info.open())
            stream.start()
            self._watching.set_stream(stream)
            self._context.status.update(camera=info.name)
            self._tick.start()
        elif info is not None and self._shown:
            self._context.status.update(camera=tr("{name}, at rest").format(name=info.name))
        self.switched.emit()

    def enter(self, shown: bool) -> None:
        """Follow the page: whether it is shown."""
        self._shown = shown
        self.open()

    def close(self) -> None:
        """Let the camera go."""
        self._tick.stop()
        self._say("")
        stream = self.stream
        if stream is not None:
            self._watching.set_stream(None)
            stream.stop()
        self._context.status.update(camera=None, rate_hz=None, dropped=None, processing_ms=None)

    def _look(self) -> None:
        if self.stream is None:
            return
        figures = self.stream.figures()
        self._context.status.update(
            rate_hz=figures.rate_hz,
            dropped=figures.dropped,
            processing_ms=self._watching.detection_ms,
        )
        self._say(figures.lost or "")

    def _say(self, why: str) -> None:
        if why != self._why:
            self._why = why
            self.lost.emit(why)
