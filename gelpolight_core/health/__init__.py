"""Checks whether an image is of this sensor, in the state in which it was calibrated."""
