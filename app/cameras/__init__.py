"""Real cameras in the application: which are connected, how they are set, and their warnings."""
