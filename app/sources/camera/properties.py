"""Camera settings through OpenCV, on systems without another interface.

OpenCV reports no ranges and no errors; only the value read back counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2

from app.sources.source import Setting
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.session.camera_controls import CONTROLS

ABSENT = -1.0


@dataclass(frozen=True, slots=True)
class _Property:
    """OpenCV's number of a setting, the range to try, and the conversion to and from our unit."""

    number: int
    low: float
    high: float
    step: float = 1.0
    ours: Callable[[float], float] = float
    theirs: Callable[[float], float] = float


def _milliseconds(log2_seconds: float) -> float:
    return 1000.0 * math.exp2(min(max(log2_seconds, -20.0), 10.0))


def _log2_seconds(milliseconds: float) -> float:
    return float(round(math.log2(max(milliseconds, 1e-3) / 1000.0)))


_WINDOWS = {
    "exposure_auto": _Property(cv2.CAP_PROP_AUTO_EXPOSURE, 0.0, 1.0),
    "exposure_ms": _Property(
        cv2.CAP_PROP_EXPOSURE, 2.0**-13 * 1000.0, 1000.0, 0.0, _milliseconds, _log2_seconds
    ),
    "white_balance_auto": _Property(cv2.CAP_PROP_AUTO_WB, 0.0, 1.0),
    "white_balance_k": _Property(cv2.CAP_PROP_WB_TEMPERATURE, 2000.0, 10000.0),
    "gain": _Property(cv2.CAP_PROP_GAIN, 0.0, 255.0),
    "focus_auto": _Property(cv2.CAP_PROP_AUTOFOCUS, 0.0, 1.0),
    "focus": _Property(cv2.CAP_PROP_FOCUS, 0.0, 255.0),
    "gamma": _Property(cv2.CAP_PROP_GAMMA, 0.0, 500.0),
    "brightness": _Property(cv2.CAP_PROP_BRIGHTNESS, -64.0, 255.0),
    "contrast": _Property(cv2.CAP_PROP_CONTRAST, 0.0, 255.0),
    "saturation": _Property(cv2.CAP_PROP_SATURATION, 0.0, 255.0),
    "sharpness": _Property(cv2.CAP_PROP_SHARPNESS, 0.0, 255.0),
}


class Properties:
    """The settings of an open capture.

    Parameters
    ----------
    capture : cv2.VideoCapture
        Open capture; its owner closes it.
    interface : int
        OpenCV's number of the interface; on macOS and for files nothing can be set.
    """

    def __init__(self, capture: Any, interface: int) -> None:
        self._capture = capture
        windows = interface in (cv2.CAP_DSHOW, cv2.CAP_MSMF)
        self._known = _WINDOWS if windows else {}

    def close(self) -> None:
        """Do nothing: no resources are held here."""

    def controls(self) -> tuple[Setting, ...]:
        """Return the settings that the camera supports."""
        found = []
        for key, kind in CONTROLS.items():
            known = self._known.get(key)
            read = ABSENT if known is None else float(self._capture.get(known.number))
            if known is None or (read == ABSENT and key != "exposure_ms"):
                continue
            value = known.ours(read)
            low, high = min(known.low, value), max(known.high, value)
            found.append(Setting(key, kind.label(), kind.unit, low, high, known.step, value))
        return tuple(found)

    def set(self, key: str, value: float) -> None:
        """Request a value.

        Raises
        ------
        InputError
            If the camera has no such setting or rejects the value.
        """
        known = self._known.get(key)
        if known is None or not self._capture.set(known.number, known.theirs(value)):
            label = CONTROLS[key].label() if key in CONTROLS else key
            raise InputError(
                f"the camera does not accept {label} {value:g}",
                "Camera",
                Remedy.NO_SUCH_SETTING,
            )
