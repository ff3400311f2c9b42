"""The complete calibration of one sensor: how it is made, and its file."""
