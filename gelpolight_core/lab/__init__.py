"""What a laboratory knows of its sensors over time."""
