"""Faults of a frame against its calibration, and the correction of its light."""
