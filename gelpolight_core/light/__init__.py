"""Check whether an image is from this sensor and whether the sensor is unchanged."""
