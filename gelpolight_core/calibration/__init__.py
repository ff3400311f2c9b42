"""The complete calibration of one sensor: its making and its file."""
