"""Other methods from colour to depth; all learn from the same ball presses."""
