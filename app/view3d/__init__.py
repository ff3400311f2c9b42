"""The 3D view of a depth map: surface, axes, colour bar, picking, pins, export."""
