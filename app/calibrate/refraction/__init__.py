"""The step `refraction` of the wizard."""
