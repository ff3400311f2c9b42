"""From an image to normals and depth (Eq. 10, Poisson)."""
