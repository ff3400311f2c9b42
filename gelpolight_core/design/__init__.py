"""Sensor designs, and the check of a design before it is built."""
