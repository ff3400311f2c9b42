"""Measure: tools on the height map, the truth beside them, and the lab's records."""
