"""The settings of cameras: their names in files, their labels, and the order to apply them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .camera_settings import settings_of_texts


@dataclass(frozen=True, slots=True)
class ControlKind:
    """A setting that a camera may have.

    Attributes
    ----------
    label : str
        For the user.
    unit : str
        Unit of the value; empty for the camera's own scale.
    automatic : str
        Key of the switch for the automatic mode; empty if there is none.
    switch : bool
        Whether it is a switch, on (1) or off (0).
    locked_value : float or None
        Value when locked; None: its present value.
    """

    label: str
    unit: str = ""
    automatic: str = ""
    switch: bool = False
    locked_value: float | None = None

    def text(self, value: float) -> str:
        """Return a value with its unit, or on or off."""
        if self.switch:
            return "on" if value else "off"
        return f"{value:g} {self.unit}".rstrip()


# Switches come before the settings that they unlock; settings are applied in this order.
CONTROLS: Mapping[str, ControlKind] = {
    "exposure_auto": ControlKind("Automatic exposure", switch=True, locked_value=0.0),
    "exposure_ms": ControlKind("Exposure", "ms", "exposure_auto"),
    "white_balance_auto": ControlKind("Automatic white balance", switch=True, locked_value=0.0),
    "white_balance_k": ControlKind("White balance", "K", "white_balance_auto"),
    "gain_auto": ControlKind("Automatic gain", switch=True, locked_value=0.0),
    "gain": ControlKind("Gain", "", "gain_auto"),
    "focus_auto": ControlKind("Automatic focus", switch=True, locked_value=0.0),
    "focus": ControlKind("Focus", "", "focus_auto"),
    "rate_follows_exposure": ControlKind(
        "Exposure may lower the frame rate", switch=True, locked_value=0.0
    ),
    "power_line_hz": ControlKind("Mains frequency", "Hz"),
    "gamma": ControlKind("Gamma"),
    "brightness": ControlKind("Brightness"),
    "contrast": ControlKind("Contrast"),
    "saturation": ControlKind("Saturation"),
    "sharpness": ControlKind("Sharpness"),
    "backlight": ControlKind("Backlight compensation"),
}
ORDER = tuple(CONTROLS)
MAIN = ("exposure_ms", "white_balance_k", "gain", "focus")
"""The settings that are most important to lock."""


def settings_facts(texts: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return labels and values of the known camera settings of a calibration.

    Parameters
    ----------
    texts : mapping
        As in the provenance of a calibration.
    """
    camera = settings_of_texts(texts)
    if camera is None:
        return ()
    width, height = camera.size
    parts = (
        camera.name,
        f"{width} \N{MULTIPLICATION SIGN} {height} px" if width and height else "",
        camera.pixel_format,
        f"{camera.rate_hz:g} images/s" if camera.rate_hz else "",
    )
    controls = tuple(
        (kind.label, kind.text(camera.controls[key]))
        for key, kind in CONTROLS.items()
        if key in camera.controls
    )
    return (("Camera", ", ".join(filter(None, parts))), *controls)
