"""The virtual sensor: a physical simulation with its own light and ray code."""
