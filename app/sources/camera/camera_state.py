"""How a camera is, as everybody may read it."""

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
    """How a camera is.

    Attributes
    ----------
    phase : str
        ``closed``: nobody uses it; ``opening``; ``live``; ``away``: tried again and again.
    sentence : str
        Why it is away.
    format : Format or None
        As read back; None before it was opened.
    offered : tuple of Format
        What it lists; empty where the system does not tell.
    controls : tuple of Setting
        As the camera told them last.
    applied : tuple of Applied
        The settings that it was asked for when it was opened or set, and what became of them.
    """

    phase: Phase = "closed"
    sentence: str = ""
    format: Format | None = None
    offered: tuple[Format, ...] = ()
    controls: tuple[Setting, ...] = ()
    applied: tuple[Applied, ...] = ()


def format_of(settings: CameraSettings | None) -> Format | None:
    """Return the format that is stored with settings; None where it is not."""
    if settings is None or not settings.pixel_format or settings.size == (0, 0):
        return None
    return Format(settings.pixel_format, *settings.size, settings.rate_hz)
