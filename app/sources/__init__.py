"""Image sources: cameras, the virtual sensor, folders and recordings, and their threads."""
