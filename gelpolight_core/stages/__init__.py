"""The stages of a calibration: each turns its images into one result with findings."""
