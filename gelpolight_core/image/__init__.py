"""Images of the camera: files, camera response, noise, grain, bad pixels and changes in time."""
