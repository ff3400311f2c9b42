"""The Calibrate page and the detections that run on its live image."""
