"""Real cameras: the driver interface, the drivers, and a camera that reconnects."""
