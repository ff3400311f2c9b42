"""From an image to normals and depth (Eq. 10): one solver for each model."""
