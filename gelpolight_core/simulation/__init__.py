"""Design and check of a sensor, and the virtual sensor with its own light and ray code."""
