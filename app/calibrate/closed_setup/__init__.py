"""The set-up step of a closed sensor."""
