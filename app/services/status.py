"""Content of the status bar. Any page updates it; the main window shows it."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QStatusBar

from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr

NUMBERS = ("rate", "processing", "dropped")


@dataclass(frozen=True, slots=True)
class Status:
    """The state of the live work. None: not known or not applicable.

    Attributes
    ----------
    camera : str or None
        Name of the open source.
    camera_note : str
        A note next to it, such as "not locked".
    rate_hz : float or None
        Frames per second.
    processing_ms : float or None
        Processing time of one frame.
    dropped : int or None
        Number of frames that were not processed since the source was opened.
    skipped_hz : float
        Recent rate of such frames, per second.
    calibration : str or None
        Name of the calibration in use.
    calibration_note : str
        A note next to it, such as "not validated".
    calibration_role : str
        Colour role of both.
    calibration_advice : str
        Why it is not reliable and what to do. Empty if it is.
    """

    camera: str | None = None
    rate_hz: float | None = None
    processing_ms: float | None = None
    dropped: int | None = None
    skipped_hz: float = 0.0
    calibration: str | None = None
    calibration_note: str = ""
    calibration_role: str = ""
    calibration_advice: str = ""
    camera_note: str = ""


class Skipped:
    """Frames skipped per second over the last seconds, from the total so far."""

    def __init__(self) -> None:
        self._counts: deque[tuple[float, int]] = deque()

    def rate_hz(self, count: int | None, now_s: float) -> float:
        """Add a total at a time and return the rate. None or a smaller total restarts it."""
        if count is None or (self._counts and count < self._counts[-1][1]):
            self._counts.clear()
        if count is None:
            return 0.0
        self._counts.append((now_s, count))
        while now_s - self._counts[0][0] > 3.0:
            self._counts.popleft()
        (first_s, first), (last_s, last) = self._counts[0], self._counts[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class StatusModel(QObject):
    """The one status of the program. Call ``status.update(rate_hz=30.0)`` in the GUI thread."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.value = Status()
        self._skipped = Skipped()

    def update(self, **changes: Any) -> None:
        """Replace some fields. Unknown names raise an error."""
        if "dropped" in changes:
            rate = self._skipped.rate_hz(changes["dropped"], time.monotonic())
            changes["skipped_hz"] = rate
        new = replace(self.value, **changes)
        if new != self.value:
            self.value = new
            self.changed.emit()


class StatusLine(QStatusBar):
    """The status bar."""

    def __init__(self, model: StatusModel) -> None:
        super().__init__()
        self._model = model
        named(self, "main.status", tr("Status"))
        self.setSizeGripEnabled(False)
        self._labels = {
            key: named(PlainLabel(parent=self), f"main.status.{key}", accessible, tip)
            for key, accessible, tip in (
                ("camera", tr("Camera"), tr("Source of the images")),
                ("rate", tr("Frame rate"), tr("Frames per second from the camera")),
                ("processing", tr("Processing time"), tr("Processing time of one frame")),
                (
                    "dropped",
                    tr("Skipped frames"),
                    tr(
                        "Frames per second skipped because newer ones arrived.\nThis is "
                        "normal. A recording keeps every frame."
                    ),
                ),
                ("calibration", tr("Calibration in use"), tr("The calibration in use")),
            )
        }
        for key, label in self._labels.items():
            if key == "calibration":
                self.addPermanentWidget(label)
            else:
                self.addWidget(label)
        model.changed.connect(self._show)
        self._show()

    def _show(self) -> None:
        status = self._model.value
        show_meaning(self._labels["calibration"], status.calibration_role)
        self._labels["calibration"].setToolTip(plain_tip(status.calibration_advice))
        for key, text in status_texts(status).items():
            label = self._labels[key]
            label.setText(text)
            label.setVisible(bool(text))
            if key in NUMBERS:
                # Reserves the width of the longest number, so that its neighbours do not move.
                label.setMinimumWidth(max(label.minimumWidth(), label.sizeHint().width()))


class FailedLine(PlainLabel):
    """Warns above every page while the calibration in use is one that failed."""

    def __init__(self, model: StatusModel) -> None:
        super().__init__()
        self._model = model
        named(self, "main.failed", tr("Warning about the calibration in use"))
        self.setWordWrap(True)
        self.setContentsMargins(10, 4, 10, 4)
        make_bold(self)
        show_meaning(self, "fail")
        model.changed.connect(self._show)
        self._show()

    def _show(self) -> None:
        status = self._model.value
        self.setVisible(status.calibration_role == "fail")
        self.setText(status.calibration_advice)


def skipped_text(rate_hz: float) -> str:
    """Return the text about skipped frames."""
    if rate_hz < 0.2:
        return tr("none skipped")
    return tr("{n:.0f} skipped per second").format(n=max(rate_hz, 1.0))


def status_texts(status: Status) -> dict[str, str]:
    """Return the text of each part of the status bar. Empty if nothing is known."""
    texts = {
        "camera": tr("No camera") if status.camera is None else status.camera,
        "rate": "" if status.rate_hz is None else tr("{x:.1f} fps").format(x=status.rate_hz),
        "processing": ""
        if status.processing_ms is None
        else tr("{x:.1f} ms").format(x=status.processing_ms),
        "dropped": "" if status.dropped is None else skipped_text(status.skipped_hz),
        "calibration": tr("No calibration in use")
        if status.calibration is None
        else status.calibration,
    }
    if status.camera is not None and status.camera_note:
        texts["camera"] += f" ({status.camera_note})"
    if status.calibration is not None and status.calibration_note:
        texts["calibration"] += f" ({status.calibration_note})"
    return texts
