"""The editor of the reflectance curves."""
