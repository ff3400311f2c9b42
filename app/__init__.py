"""The desktop program and the command line over the core."""
