"""Depth of a closed sensor."""
