"""The calibration of a sensor as data: identity, origin, quality, and what is calibrated."""
