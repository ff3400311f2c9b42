"""The folder in which sensors, their calibrations and their sessions are kept; no Qt."""
