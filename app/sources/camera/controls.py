"""The settings of cameras: their names in files, what people read, and in which order they go."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class ControlKind:
    """A setting that cameras may have.

    Attributes
    ----------
    label : callable
        Returns what people read.
    unit : str
        Of its value; empty for the camera's own scale.
    automatic : str
        Key of the switch that leaves it to the camera; empty where there is none.
    switch : bool
        Whether it is on (1) or off (0).
    held : float or None
        What it is locked to; None: what it has.
    """

    label: Callable[[], str]
    unit: str = ""
    automatic: str = ""
    switch: bool = False
    held: float | None = None


# Switches go before what they release; that order is the one in which settings are applied.
CONTROLS: Mapping[str, ControlKind] = {
    "exposure_auto": ControlKind(lambda: tr("Exposure by the camera"), switch=True, held=0.0),
    "exposure_ms": ControlKind(lambda: tr("Exposure"), "ms", "exposure_auto"),
    "white_balance_auto": ControlKind(
        lambda: tr("White balance by the camera"), switch=True, held=0.0
    ),
    "white_balance_k": ControlKind(lambda: tr("White balance"), "K", "white_balance_auto"),
    "gain_auto": ControlKind(lambda: tr("Gain by the camera"), switch=True, held=0.0),
    "gain": ControlKind(lambda: tr("Gain"), "", "gain_auto"),
    "focus_auto": ControlKind(lambda: tr("Focus by the camera"), switch=True, held=0.0),
    "focus": ControlKind(lambda: tr("Focus"), "", "focus_auto"),
    "rate_follows_exposure": ControlKind(
        lambda: tr("Rate follows the exposure"), switch=True, held=0.0
    ),
    "power_line_hz": ControlKind(lambda: tr("Mains frequency"), "Hz"),
    "gamma": ControlKind(lambda: tr("Gamma")),
    "brightness": ControlKind(lambda: tr("Brightness")),
    "contrast": ControlKind(lambda: tr("Contrast")),
    "saturation": ControlKind(lambda: tr("Saturation")),
    "sharpness": ControlKind(lambda: tr("Sharpness")),
    "backlight": ControlKind(lambda: tr("Backlight compensation")),
}
ORDER = tuple(CONTROLS)
MAIN = ("exposure_ms", "white_balance_k", "gain", "focus")
"""What is locked first of all."""
