"""The step `background` of the wizard."""
