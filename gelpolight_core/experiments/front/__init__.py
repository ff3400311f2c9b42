"""Error against run time of every method, sensor by sensor."""
