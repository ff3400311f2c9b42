"""The membrane beside the white board, on a field that is shaded here."""

import numpy as np
import pytest

from gelpolight_core.calibration.board_ratio import BOARD_REFLECTANCE, BOARD_SD, MembraneBoardRatio
from gelpolight_core.light.membrane_brdf import MembraneBrdf

LEDS = np.array([[0.0, 10.0, -8.0], [-9.0, -5.0, -8.0], [9.0, -5.0, -8.0]])


def beside(reflectance: float) -> MembraneBoardRatio:
    """Return a Lambertian membrane of a reflectance in units of the board's."""
    x, y = (m.ravel() for m in np.meshgrid(np.linspace(-8, 8, 17), np.linspace(-6, 6, 13)))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    view = np.tile([0.0, 0.0, -1.0], (len(x), 1))
    return MembraneBoardRatio(points, view, np.full((len(x), 3), reflectance))


def test_a_matt_membrane_reflects_what_it_shows_beside_the_board():
    assert beside(0.6).reflectance(LEDS, MembraneBrdf()) == pytest.approx(0.6, rel=1e-6)


def test_a_lobe_that_the_camera_hardly_sees_leaves_more_reflectance():
    """Far from the mirror images of the lights, half of the light goes elsewhere."""
    glossy = beside(0.4).reflectance(LEDS, MembraneBrdf(gloss=0.5, roughness=0.2))
    assert 0.6 < glossy < 0.8


def test_it_is_expected_unless_balls_show_something_else_altogether():
    board, matt = beside(0.8), MembraneBrdf()
    expected = board.expected(LEDS, matt, (0.7, 0.05))
    assert expected == pytest.approx((BOARD_REFLECTANCE * 0.8, BOARD_SD * 0.8))
    # As after half the exposure for the white board.
    assert beside(1.6).expected(LEDS, matt, (0.7, 0.05)) is None
    nothing = MembraneBoardRatio(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    assert nothing.expected(LEDS, matt, (0.7, 0.05)) is None
