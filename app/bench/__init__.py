"""The virtual bench: the user chooses the object on the virtual sensor."""
