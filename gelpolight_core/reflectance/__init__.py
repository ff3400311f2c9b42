"""The membrane's reflectance table from ball presses (Eq. 6-8)."""
