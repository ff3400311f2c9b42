"""Real cameras: what drivers offer, the drivers, and a camera that survives being unplugged."""
