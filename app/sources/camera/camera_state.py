"""The state of a camera; any thread may read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.sources.camera.applying import Applied
from app.sources.camera.driver import Format
from app.sources.source import Setting
from gelpolight_core.session.camera_settings import CameraSettings

Phase = Literal["closed", "opening", "live", "away"]


@dataclass(frozen=True, slots=True)
class CameraState:
    """The state of a camera.

    Attributes
    ----------
    phase : str
        ``closed`` (not used), ``opening``, ``live``, or ``away`` (tried again repeatedly).
    sentence : str
        Why the camera is away.
    format : Format or None
        Format as read back; None before the camera was opened.
    offered : tuple of Format
        Formats that the camera lists; empty if the system does not report them.
    controls : tuple of Setting
        Settings as last reported by the camera.
    applied : tuple of Applied
        Settings requested when the camera was opened or set, with their results.
    """

    phase: Phase = "closed"
    sentence: str = ""
    format: Format | None = None
    offered: tuple[Format, ...] = ()
    controls: tuple[Setting, ...] = ()
    applied: tuple[Applied, ...] = ()


def format_of(settings: CameraSettings | None) -> Format | None:
    """Return the format stored with settings; None if it is not stored."""
    if settings is None or not settings.pixel_format or settings.size == (0, 0):
        return None
    return Format(settings.pixel_format, *settings.size, settings.rate_hz)
