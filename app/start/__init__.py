"""The Start page: continue the last work, or begin new work."""
