"""Calibration of closed sensors from a background and a few ball presses."""
