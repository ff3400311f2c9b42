"""The calibration of a sensor as data: identity, origin, quality and calibrated values."""
