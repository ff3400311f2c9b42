"""The record button: writes every frame to a file and counts lost frames."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.live.live_depth import LiveDepth
from app.program.context import AppContext
from app.sources.recorder import (
    Recorder,
    RecorderFigures,
    RecordingSpace,
    free_bytes,
    header_for,
    recording_space,
)
from app.widgets.actions import make_action
from app.widgets.timers import timer


class RecordControl(QObject):
    """Records the frames of the source.

    Parameters
    ----------
    depth : LiveDepth
        Holds the open source.
    owner : QWidget
        Gets the action.
    report : callable
        Called with the status of the recording, and whether frames are lost. Empty if there is
        none.
    context : AppContext
        Holds the library and the messages.
    """

    def __init__(
        self,
        depth: LiveDepth,
        owner: QWidget,
        report: Callable[[str, bool], object],
        *,
        context: AppContext,
    ) -> None:
        super().__init__(owner)
        self._report = report
        self._depth, self._context = depth, context
        self._recorder: Recorder | None = None
        self._warned = self._offered = False
        tip, text = "Record every frame without loss", "Record"
        self.action = make_action(
            owner, "inspect.record", text, self.toggle, keys=("R",), icon_name="record", tip=tip
        )
        self.action.setCheckable(True)
        self._timer = timer(self, 300, self._poll)
        depth.live.switched.connect(self._on_switched)

    @property
    def busy(self) -> bool:
        """Whether a recording is running or still being written."""
        return self._recorder is not None

    def toggle(self) -> None:
        """Start recording, or stop it."""
        if self._recorder is None:
            self.start()
        else:
            self.stop()

    def start(self) -> None:
        """Record into a new file of the sensor's folder."""
        stream, info = self._depth.live.stream, self._context.source.info
        self.action.setChecked(False)
        if stream is None or info is None:
            text = "No camera is selected. Choose an image source first."
            self._context.toasts.show(text, "warn")
            return
        reconstructor = self._depth.reconstructor
        calibration = None if reconstructor is None else reconstructor.calibration
        serial = "" if calibration is None else calibration.serial
        identity = "" if calibration is None else calibration.identity
        header = header_for(stream.source, serial=serial, calibration_id=identity)
        with self._context.toasts.errors():
            path = self._context.workspace.recording_path(serial or "unknown")
            self._recorder = Recorder(stream, path, header)
            self._recorder.start()
            self._warned = self._offered = False
            self.action.setChecked(True)
            self._timer.start()

    def _on_switched(self) -> None:
        """Stop recording a stream that was closed: a reopened camera is a new stream."""
        if self._recorder is not None and self._recorder.stream is not self._depth.live.stream:
            self.stop()

    def stop(self) -> None:
        """Accept no more frames. Waiting frames are still written in the background."""
        if self._recorder is not None:
            self._recorder.finish()
        self.action.setChecked(False)

    def close(self) -> None:
        """Stop recording, and wait until everything is written."""
        self._timer.stop()
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.stop()

    def _poll(self) -> None:
        if self._recorder is None:
            return
        figures = self._recorder.figures()
        if figures.finished:
            self._report_finished(self._recorder, figures)
            return
        if not self.action.isChecked():
            self.action.setText("Writing…")
            self._report(f"Writing: {recorder_text(figures)}", figures.lost > 0)
            return
        room = recording_space(
            figures,
            free_bytes=free_bytes(self._recorder.path),
            limit_bytes=1e9 * self._context.settings.preferences.recording_limit_gb,
        )
        self.action.setText(f"{time_text(figures.seconds)}, {left_text(room)}")
        # A frozen image is not what is recorded.
        what = "Recording the live image" if self._depth.live.paused else "Recording"
        text = f"{what}: {recorder_text(figures)}, {left_text(room)}"
        self._report(text, figures.lost > 0)
        self._heed(room)
        if figures.lost and not self._offered:
            self._offer_half(self._recorder, figures)

    def _heed(self, room: RecordingSpace) -> None:
        """Stop when there is no room left, and warn a minute before."""
        if room.full:
            self.stop()
            reason = "The recording reached its size limit and was stopped. See Preferences."
            if not room.by_limit:
                reason = "The disk is almost full. The recording was stopped."
            self._context.toasts.show(reason, "warn")
        elif room.soon_full and not self._warned:
            self._warned = True
            reason = "it reaches its size limit" if room.by_limit else "the disk is almost full"
            text = f"The recording stops in {time_text(room.left_s)}: {reason}."
            self._context.toasts.show(text, "warn")

    def _offer_half(self, recorder: Recorder, figures: RecorderFigures) -> None:
        """Say that frames are lost, and offer half the rate. Once, and again if that is chosen."""

        def halve() -> None:
            recorder.halve_rate()
            self._offered = False

        self._offered = True
        text = (
            f"The recording loses frames ({figures.lost} of {figures.frames + figures.lost}): "
            "this computer or its disk is too slow."
        )
        action = "Record every second frame", halve
        self._context.toasts.show(text, "fail", actions=(action,))

    def _report_finished(self, recorder: Recorder, figures: RecorderFigures) -> None:
        self._recorder = None
        self._timer.stop()
        self.action.setChecked(False)
        self.action.setText("Record")
        self._report("", False)
        if figures.failure:
            self._context.toasts.show(figures.failure, "fail")
            return
        text = f"Recorded {recorder_text(figures)} to {recorder.path}"
        replay = ("Replay", lambda: self._context.source.choose_recording(recorder.path))
        kind = "warn" if figures.lost else "pass"
        self._context.toasts.show(text, kind, actions=(replay,))


def recorder_text(figures: RecorderFigures) -> str:
    """Return the status of a recording, including losses."""
    text = f"{figures.frames} frames, {figures.seconds:.1f} s, {1e-6 * figures.size_bytes:.0f} MB"
    if figures.lost:
        text += f", {figures.lost} lost"
    return text


def time_text(seconds: float) -> str:
    """Return a time as minutes and seconds, or as hours and minutes."""
    whole_seconds = int(seconds)
    if whole_seconds >= 3600:
        return f"{whole_seconds // 3600} h {whole_seconds % 3600 // 60:02d} min"
    return f"{whole_seconds // 60}:{whole_seconds % 60:02d} min"


def left_text(room: RecordingSpace) -> str:
    """Return how long a recording can go on."""
    if math.isinf(room.left_s):
        return f"{1e-9 * room.left_bytes:.0f} GB left"
    return f"{time_text(room.left_s)} left"
