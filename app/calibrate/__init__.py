"""The Calibrate page: a wizard with a step for each stage, and detections in its live image."""
