"""Widgets of the sources of images: cameras, virtual bench, choice of source."""
