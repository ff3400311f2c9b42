"""The step `reflectance` of the wizard."""
