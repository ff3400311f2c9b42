"""The calibration wizard and the editors that it opens."""
