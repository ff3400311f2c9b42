"""The Inspect page: live depth in 3D and as maps, cross-sections, recording, export, streaming."""
