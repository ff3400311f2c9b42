"""What is known of a calibrated sensor."""
