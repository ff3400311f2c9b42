"""Faults of a frame: what changed since the calibration, and what of it is corrected."""
