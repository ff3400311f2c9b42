"""The state of the work. Any page updates it, and the state bar of the window shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from PySide6.QtCore import QObject, Signal


@dataclass(frozen=True, slots=True)
class LiveStatus:
    """The state of the live work. None: not known or not applicable.

    Attributes
    ----------
    camera_note : str
        A note next to the name of the source, such as "not locked".
    rate_hz : float or None
        Frames per second.
    lost : int or None
        Number of frames that did not arrive since the source was opened.
    sensor : str
        Serial of the sensor that is used or calibrated.
    task : str
        Present work other than measuring, such as "Calibrating: 7 of 9".
    calibration : str
        The calibration in use, such as "Calibration of 2026-03-01, not validated". Empty: none.
    calibration_role : str
        Colour role of `calibration`.
    calibration_advice : str
        Advice if the calibration is not reliable. Empty if it is.
    """

    camera_note: str = ""
    rate_hz: float | None = None
    lost: int | None = None
    sensor: str = ""
    task: str = ""
    calibration: str = ""
    calibration_role: str = ""
    calibration_advice: str = ""


class StatusModel(QObject):
    """The one status of the program. Call ``status.update(rate_hz=30.0)`` in the GUI thread."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.value = LiveStatus()

    def update(self, **changes: Any) -> None:
        """Replace some fields. Unknown names raise an error."""
        value = replace(self.value, **changes)
        if value != self.value:
            self.value = value
            self.changed.emit()
