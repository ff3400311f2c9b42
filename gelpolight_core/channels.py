"""The three colour channels; channel k is lit by LED k."""

from __future__ import annotations

CHANNEL_KEYS = ("red", "green", "blue")


def channel_name(channel: int) -> str:
    """Return the display name of a channel (0, 1, 2)."""
    return ("red", "green", "blue")[channel]
