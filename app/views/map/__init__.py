"""The height map as an image."""
