"""Camera model, refraction, resampling grid, shape of the membrane, and fits to points."""
