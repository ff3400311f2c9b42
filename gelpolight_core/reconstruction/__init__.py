"""From a picture to normals and depth (Eq. 10, Poisson)."""
