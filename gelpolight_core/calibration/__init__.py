"""The calibration of a sensor: stages, recipes, joint refinement, and the calibration file."""
