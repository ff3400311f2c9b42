"""Sizes of pressed objects, and the paper's evaluation."""
