"""The validation step of a closed sensor."""
