"""Integration alone: several integrators on surfaces with an exact formula."""
