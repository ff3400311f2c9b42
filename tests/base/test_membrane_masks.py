"""One definition each of saturated, lit, dark and usable."""

import numpy as np

from gelpolight_core.base import membrane_masks


def test_the_two_uppermost_numbers_of_eight_bits_are_saturated():
    """A camera's 254 may be its 255 with another pedestal; 253 is light."""
    light = np.array([0, 128, 253, 254, 255]) / 255.0
    np.testing.assert_array_equal(
        membrane_masks.saturated_mask(light), [False, False, False, True, True]
    )


def test_a_node_is_usable_in_view_with_light_and_reflectance_in_all_channels():
    valid = np.array([[True, True, True, False]])
    light = np.array([[[0.5, 0.5, 0.5], [0.5, 0.5, 0.005], [0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]])
    factors = np.array([[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]])
    np.testing.assert_array_equal(
        membrane_masks.usable_mask(valid, light, factors), [[True, False, False, False]]
    )
