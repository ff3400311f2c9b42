"""The calibration report and that of an evaluation: data, drawings, and one template."""
