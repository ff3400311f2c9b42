"""The three colour channels; channel k is lit by LED k."""

CHANNEL_KEYS = ("red", "green", "blue")
