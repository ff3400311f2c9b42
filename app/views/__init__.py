"""Views of a height map, as an image (``map``) and in 3D (``surface``)."""
