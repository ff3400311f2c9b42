"""The Sensors page: the library of sensors and their calibrations."""
