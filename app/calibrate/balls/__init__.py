"""The step `balls` of the wizard."""
