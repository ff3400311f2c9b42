"""Inspect: live depth in 3D and as maps, with cross-sections."""
