"""The camera response from a series of exposures."""
