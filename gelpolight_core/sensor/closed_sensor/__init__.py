"""The calibrated data of a closed sensor: working grid, colour change and slope polynomials."""
