"""Reflectance factors of the bare membrane (Eq. 9)."""
