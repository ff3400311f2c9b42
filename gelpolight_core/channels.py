"""The three colour channels; channel k is lit by LED k."""

from __future__ import annotations

from gelpolight_core.translation import tr

CHANNEL_KEYS = ("red", "green", "blue")


def channel_name(channel: int) -> str:
    """Return the display name of a channel (0, 1, 2)."""
    return (tr("red"), tr("green"), tr("blue"))[channel]
