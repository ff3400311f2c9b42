"""Camera settings, stored with the images of a session and with a calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from gelpolight_core.base.codec import pack, place
from gelpolight_core.base.limits import Span, Words

LONGEST = 300
MOST = 64
MOST_VALUE = 1e9
_CONTROL = "control."
Name = Annotated[str, Words()]
MaybeName = Annotated[str, Words(may_be_empty=True)]
Px = Annotated[int, Span(0, 65535)]


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Identity of a camera, with the settings at which its images were taken.

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

    name: Name = place("device.name")
    identity: Name = place("device.identity")
    model: MaybeName = place("device.model", default="")
    pixel_format: MaybeName = place("device.pixel_format", default="")
    size: tuple[Px, Px] = place("device.width", "device.height", default=(0, 0))
    rate_hz: Annotated[float, Span(0.0, 1e5)] = place("device.rate_hz", default=0.0)
    controls: Mapping[str, Annotated[float, Span(-MOST_VALUE, MOST_VALUE)]] = field(
        default_factory=dict
    )

    def as_texts(self) -> dict[str, str]:
        """Return the settings as texts for a calibration file."""
        texts = {key: str(value) for key, value in pack(self, {}, "")["device"].items()}
        return texts | {f"{_CONTROL}{key}": f"{v:.10g}" for key, v in self.controls.items()}


def settings_of_texts(texts: Mapping[str, str]) -> CameraSettings | None:
    """Return the camera settings stored in a calibration, or None.

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
    return number if math.isfinite(number) and abs(number) <= MOST_VALUE else None
