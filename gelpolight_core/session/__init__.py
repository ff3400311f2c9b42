"""Session folders: what was captured of one sensor, read and checked."""
