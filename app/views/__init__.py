"""Views of a height map."""
