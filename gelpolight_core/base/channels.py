"""The three colour channels, where LED k lights channel k."""

CHANNEL_KEYS = ("red", "green", "blue")
