"""A hole in the field, such as a speck or a saturated spot, has the depth of what is around it."""

import known_press
import numpy as np

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.studies.exact_sensor import matt_design


def test_a_hole_on_a_face_is_filled_in_and_flagged():
    known = known_press.known_sensor(matt_design(0.25))
    calibration = known.calibration
    frame = known_press.on(known, CylinderIndenter(6.0, 0.6)).frame
    x, y = np.meshgrid(calibration.table.grid.x_mm, calibration.table.grid.y_mm)
    whole = Reconstructor(calibration).depth(frame).depth_mm
    deepest = np.unravel_index(np.argmax(whole), whole.shape)
    middle = np.median(np.argwhere(whole > 0.9 * whole[deepest]), axis=0).astype(int)
    hole = np.hypot(x - x[tuple(middle)], y - y[tuple(middle)]) < 0.8
    factors = np.where(hole[..., None], np.float32(0.0), calibration.data.factors)
    found = Reconstructor(calibration.changed(factors=factors)).depth(frame)
    assert np.abs(found.depth_mm[hole] / whole[hole] - 1.0).max() < 0.03
    lost = int(Flag.OUTSIDE | Flag.INVALID)
    assert ((found.flags[hole] & lost) == lost).all()
    outside = ~calibration.table.valid
    assert not found.depth_mm[outside].any()
