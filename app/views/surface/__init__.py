"""The height map as a 3D surface: scene, picking, menu and export."""
