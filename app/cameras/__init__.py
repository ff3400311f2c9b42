"""Real cameras in the window: which there are, how they are set, and what is said of them."""
