"""Health of a frame: its changes since the background of the calibration."""
