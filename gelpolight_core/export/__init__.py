"""Export of height maps to files for other programs."""
