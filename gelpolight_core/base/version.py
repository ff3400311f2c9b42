"""Version of the program and the library."""

__version__ = "1.0.0"
