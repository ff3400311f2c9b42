"""The camera of a session and its settings, kept with the images and with the calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gelpolight_core.session.table import Table

LONGEST = 300
MOST = 64
_CONTROL = "control."


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Settings of a camera.

    Attributes
    ----------
    name : str
        Display name.
    identity : str
        Vendor and product; the serial number, if the camera has one; the port it is plugged into.
    model : str
        Vendor and product id, such as ``046d:081b``; empty if unknown.
    pixel_format : str
        Four characters, such as ``YUYV``; empty if unknown.
    size : (int, int)
        Width and height of its images, px.
    rate_hz : float
        Frames per second.
    controls : mapping
        Value of each setting, such as ``exposure_ms``; on/off settings are 0 or 1.
    """

    name: str
    identity: str
    model: str = ""
    pixel_format: str = ""
    size: tuple[int, int] = (0, 0)
    rate_hz: float = 0.0
    controls: Mapping[str, float] = field(default_factory=dict)

    def as_table(self) -> dict[str, Any]:
        """Return the settings as tables of ``session.toml``."""
        device = {
            "name": self.name,
            "identity": self.identity,
            "model": self.model,
            "pixel_format": self.pixel_format,
            "width": self.size[0],
            "height": self.size[1],
            "rate_hz": self.rate_hz,
        }
        return {"device": device, "controls": dict(self.controls)}

    def as_texts(self) -> dict[str, str]:
        """Return the settings as texts for a calibration file; see :func:`settings_of_texts`."""
        texts = {key: str(value) for key, value in self.as_table()["device"].items()}
        return texts | {f"{_CONTROL}{key}": f"{v:.10g}" for key, v in self.controls.items()}


def parse_settings(camera: Table) -> CameraSettings:
    """Return the settings of ``[camera.device]`` and ``[camera.controls]``.

    Raises
    ------
    InputError
        If a key is unknown, has the wrong type, or is out of range.
    """
    device = camera.table("device")
    given = camera.table("controls") if "controls" in camera.content else Table({}, "", camera.path)
    if len(given.content) > MOST:
        raise camera.wrong("controls", "has more settings than any camera")
    controls = {str(key): given.number(str(key), -1e9, 1e9) for key in given.content}
    device.no_more("name", "identity", "model", "pixel_format", "width", "height", "rate_hz")
    return CameraSettings(
        device.text("name")[:LONGEST],
        device.text("identity")[:LONGEST],
        _maybe(device, "model"),
        _maybe(device, "pixel_format"),
        (round(device.number("width", 0, 65535, 0)), round(device.number("height", 0, 65535, 0))),
        device.number("rate_hz", 0.0, 1e5, 0.0),
        controls,
    )


def _maybe(table: Table, key: str) -> str:
    """Return a text that may be empty or missing."""
    return table.text(key)[:LONGEST] if table.content.get(key) not in (None, "") else ""


def settings_of_texts(texts: Mapping[str, str]) -> CameraSettings | None:
    """Return the camera settings stored in a calibration; None if there are no usable ones.

    A calibration file can come from anywhere: values that are not valid numbers or texts are left
    out.
    """
    plain = {k: v for k, v in list(texts.items())[: 2 * MOST] if isinstance(v, str)}
    name, identity = plain.get("name", ""), plain.get("identity", "")
    if not name or not identity:
        return None
    numbers = {key: number for key, text in plain.items() if (number := _number(text)) is not None}
    return CameraSettings(
        name[:LONGEST],
        identity[:LONGEST],
        plain.get("model", "")[:LONGEST],
        plain.get("pixel_format", "")[:LONGEST],
        (int(numbers.get("width", 0.0)), int(numbers.get("height", 0.0))),
        numbers.get("rate_hz", 0.0),
        {k.removeprefix(_CONTROL): v for k, v in numbers.items() if k.startswith(_CONTROL)},
    )


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) and abs(number) <= 1e9 else None
