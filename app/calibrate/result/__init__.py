"""The step `result` of the wizard."""
