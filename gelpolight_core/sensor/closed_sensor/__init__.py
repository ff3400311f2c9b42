"""What is known of a calibrated closed sensor."""
