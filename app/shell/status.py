"""What the status bar shows: fed by whoever knows, shown by the main window."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QLabel, QStatusBar

from app.widgets.naming import named
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Status:
    """The state of the live work; None where it is not known or does not apply.

    Attributes
    ----------
    camera : str or None
        Name of the open source.
    rate_hz : float or None
        Frames a second.
    processing_ms : float or None
        Time of the processing of one frame.
    dropped : int or None
        Frames that were not processed since the source was opened.
    calibration : str or None
        Name of the calibration in use.
    calibration_note : str
        A word beside it, such as "not validated".
    """

    camera: str | None = None
    rate_hz: float | None = None
    processing_ms: float | None = None
    dropped: int | None = None
    calibration: str | None = None
    calibration_note: str = ""


class StatusModel(QObject):
    """The one status of the program; ``status.update(rate_hz=30.0)`` from the GUI thread."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.value = Status()

    def update(self, **changes: Any) -> None:
        """Replace some fields; unknown names are refused."""
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
            key: named(QLabel(self), f"main.status.{key}", accessible, tip)
            for key, accessible, tip in (
                ("camera", tr("Camera"), tr("Where the pictures come from")),
                ("rate", tr("Frame rate"), tr("Frames a second from the camera")),
                ("processing", tr("Processing time"), tr("Time to process one frame")),
                ("dropped", tr("Dropped frames"), tr("Frames that were not processed")),
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
        for key, text in status_texts(self._model.value).items():
            label = self._labels[key]
            label.setText(text)
            label.setVisible(bool(text))


def status_texts(status: Status) -> dict[str, str]:
    """Return what each place of the status bar says; empty where nothing is known."""
    texts = {
        "camera": tr("No camera") if status.camera is None else status.camera,
        "rate": "" if status.rate_hz is None else tr("{x:.1f} fps").format(x=status.rate_hz),
        "processing": ""
        if status.processing_ms is None
        else tr("{x:.1f} ms").format(x=status.processing_ms),
        "dropped": "" if status.dropped is None else tr("{n} dropped").format(n=status.dropped),
        "calibration": tr("No calibration in use")
        if status.calibration is None
        else status.calibration,
    }
    if status.calibration is not None and status.calibration_note:
        texts["calibration"] += f" ({status.calibration_note})"
    return texts
