"""The live picture: shown, checked, drawn upon."""
