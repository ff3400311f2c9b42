"""Lens, pose, refraction, and the one resampling table from raw pixels to the membrane."""
