"""The step `lens` of the wizard."""
