"""The record button: every frame into a file, and how many were lost."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from app.inspect.link import LiveLink
from app.shell.actions import make_action
from app.shell.context import AppContext
from app.sources.recorder import Recorder, RecorderFigures, header_for
from app.workspace.workspace import Workspace
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder
from gelpolight_core.recording.recording import ENDING
from gelpolight_core.translation import tr

POLL_MS = 300


class RecordControl(QObject):
    """Records what the source delivers.

    Signals
    -------
    told(str)
        How the recording fares; empty when there is none.
    """

    told = Signal(str)

    def __init__(self, link: LiveLink, owner: QWidget, *, context: AppContext) -> None:
        super().__init__(owner)
        self._link, self._context = link, context
        self._recorder: Recorder | None = None
        self.action: QAction = make_action(
            owner, "inspect.record", tr("Record"), self.toggle, keys=("R",), icon_name="record",
            tip=tr("Record every frame, lossless (R)"),
        )  # fmt: skip
        self.action.setCheckable(True)
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll)
        link.switched.connect(self._on_switched)

    @property
    def busy(self) -> bool:
        """Whether a recording is under way, or still being written."""
        return self._recorder is not None

    def toggle(self) -> None:
        """Begin to record, or end it."""
        if self._recorder is None:
            self.start()
        else:
            self.stop()

    def start(self) -> None:
        """Record into a new file of the sensor's folder."""
        stream, info = self._link.stream, self._context.source.info
        if stream is None or info is None:
            self.action.setChecked(False)
            self._context.toasts.show(tr("There is no camera. Choose a source first."), "warn")
            return
        reconstructor = self._link.reconstructor
        calibration = None if reconstructor is None else reconstructor.calibration
        serial = "" if calibration is None else calibration.sensor.serial
        header = header_for(
            stream.source,
            serial=serial,
            calibration_id="" if calibration is None else calibration.identity,
        )
        try:
            path = recording_path(self._context.workspace, serial or "unknown")
        except InputError as error:
            self.action.setChecked(False)
            self._context.toasts.show(str(error), "fail")
            return
        self._recorder = Recorder(stream, path, header)
        self._recorder.start()
        self.action.setChecked(True)
        self._timer.start()

    def _on_switched(self) -> None:
        """End a recording of a stream that has gone: the same camera, opened again, is another."""
        if self._recorder is not None and self._recorder.stream is not self._link.stream:
            self.stop()

    def stop(self) -> None:
        """Take no more frames; what waits for the disk is still written, meanwhile."""
        if self._recorder is not None:
            self._recorder.finish()
        self.action.setChecked(False)

    def close(self) -> None:
        """End the recording, and wait for what is still to be written."""
        self._timer.stop()
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.stop()

    def _poll(self) -> None:
        if self._recorder is None:
            return
        figures = self._recorder.figures()
        if figures.finished:
            self._tell_finished(self._recorder, figures)
            return
        words = tr("Recording: {words}") if self.action.isChecked() else tr("Writing: {words}")
        self.told.emit(words.format(words=recorder_text(figures)))

    def _tell_finished(self, recorder: Recorder, figures: RecorderFigures) -> None:
        self._recorder = None
        self._timer.stop()
        self.action.setChecked(False)
        self.told.emit("")
        if figures.failure:
            self._context.toasts.show(figures.failure, "fail")
            return
        text = tr("Recorded {words} to {path}").format(
            words=recorder_text(figures), path=recorder.path
        )
        replay = (tr("Replay"), lambda: self._context.source.choose_recording(recorder.path))
        kind = "warn" if figures.lost else "pass"
        self._context.toasts.show(text, kind, actions=(replay,))


def recording_path(workspace: Workspace, serial: str) -> Path:
    """Return the place of a new recording; its folder is made."""
    folder = workspace.sensor_folder(serial) / "recordings"
    make_folder(folder)
    stem = f"{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
    path, number = folder / f"{stem}{ENDING}", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}{ENDING}"
    return path


def recorder_text(figures: RecorderFigures) -> str:
    """Return how a recording fares, losses included."""
    text = tr("{n} frames, {s:.1f} s, {mb:.0f} MB").format(
        n=figures.frames, s=figures.seconds, mb=1e-6 * figures.size_bytes
    )
    if figures.lost:
        text += tr(", {n} lost").format(n=figures.lost)
    return text
