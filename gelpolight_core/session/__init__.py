"""Session folders: the images captured of one sensor, read and checked."""
