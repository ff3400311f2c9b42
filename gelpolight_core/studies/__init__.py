"""Studies: error against run time, and numerical stability."""
