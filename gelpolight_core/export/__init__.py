"""Height maps as files that other programs read."""
