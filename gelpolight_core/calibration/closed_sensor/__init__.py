"""Calibration of closed sensors from ball presses alone."""
