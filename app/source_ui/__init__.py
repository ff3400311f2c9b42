"""Widgets of the image sources: camera settings, virtual bench, choice of source."""
