"""The light of a sensor at a point of the membrane: reflectance, and light between its parts."""
