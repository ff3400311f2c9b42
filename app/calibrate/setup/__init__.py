"""The step `setup` of the wizard."""
