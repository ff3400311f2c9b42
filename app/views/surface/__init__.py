"""The height map as a 3D surface."""
