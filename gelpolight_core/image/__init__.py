"""Images of the camera: decoded from files, with the camera response corrected."""
