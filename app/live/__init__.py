"""The live image: display, checks and overlays."""
