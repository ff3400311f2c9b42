"""Experiments on the method itself: what its parts are worth and what they cost."""
