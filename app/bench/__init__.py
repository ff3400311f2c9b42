"""Controls of the virtual bench, the objects on the virtual sensor."""
