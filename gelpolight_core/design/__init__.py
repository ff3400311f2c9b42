"""Sensor designs, and what can be said of one before it is built."""
