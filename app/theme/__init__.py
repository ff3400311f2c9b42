"""Colours, styles and icons of the window."""
