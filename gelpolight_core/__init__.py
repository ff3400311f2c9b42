"""GelPoLight: from pictures of a point-lit tactile sensor to depth in millimetres."""

__version__ = "0.1.0"
