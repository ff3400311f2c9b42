"""Light intensity from the white board (Eq. 5), reflectance factors from the background (Eq. 9)."""
