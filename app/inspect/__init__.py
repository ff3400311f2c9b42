"""Inspect: depth live in 3D and as maps, looked at and cut through."""
