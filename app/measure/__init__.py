"""The Measure page: tools on the height map, comparison with true values, and the lab's records."""
