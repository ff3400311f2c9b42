"""The step `validation` of the wizard."""
