"""What changed between the background of a calibration and a frame, and whether the rest fits."""
