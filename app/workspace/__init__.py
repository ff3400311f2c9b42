"""The folder that contains sensors, their calibrations and their sessions. Without Qt."""
