"""The virtual bench: what lies on the virtual sensor, chosen by hand."""
