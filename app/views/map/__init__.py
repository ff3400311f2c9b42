"""The height map as an image: colours, processing, sections and values at a point."""
