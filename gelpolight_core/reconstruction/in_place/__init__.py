"""The model of closed sensors: colour change and position to slope, slopes to depth."""
