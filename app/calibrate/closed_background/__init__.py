"""The background step of a closed sensor."""
