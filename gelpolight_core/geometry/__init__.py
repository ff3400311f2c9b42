"""Circles, spheres and planes through points, and weights that leave out what does not belong."""
