"""The step `lights` of the wizard."""
