"""Ball presses: detection, geometry and the reflectance curve (Eq. 6 to 8)."""
