"""The step of the ball presses on a closed sensor."""
