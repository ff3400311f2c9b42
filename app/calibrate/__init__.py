"""The calibration pages and what they show of each picture."""
