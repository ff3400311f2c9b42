"""The step `radiance` of the wizard."""
