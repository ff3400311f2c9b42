"""Checkerboards: lens and pose of the top surface."""
