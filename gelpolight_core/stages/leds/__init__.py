"""Positions of the LEDs from the mirror, and crosstalk of the channels."""
