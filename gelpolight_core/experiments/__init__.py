"""Experiments on the method itself: the benefit and the cost of its parts."""
