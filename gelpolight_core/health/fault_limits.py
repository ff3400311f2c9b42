"""Sizes from which on a change of a frame is stated as a fault, or costs too much."""

SIGMAS, CLEAR = 3.0, 2.0
"""Standard deviations from which on a change is stated, and up to which it may explain an error."""
GAIN, OFFSET, SHIFT_PX, BLUR_PX = 0.0022, 0.0003, 0.6, 1.4
"""Changes that make a press of 1 mm wrong by 1 %: of all light, of room light as a share of full
scale, of the camera's place, of the sharpness."""
ALONE = 2.0
"""Of a single channel, more is needed by this factor."""
DARK = 0.2
"""Share of the light at calibration below which an LED is off."""
MOSTLY_SATURATED = 0.3
"""Share of the field from which on saturation makes the heights meaningless."""
LEAST_UNTOUCHED = 0.12
"""Share of the field that must look as at calibration; otherwise all faults are unknown."""
