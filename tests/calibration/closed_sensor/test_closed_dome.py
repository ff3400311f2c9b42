"""A closed sensor with a dome: background and balls of a rendered sensor."""

import pytest

from gelpolight_core._api import measure, read_image
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import read_session
from tests.calibration.closed_sensor.conftest import close_session, few

MM_PER_PX = 0.0251
"""By the calibration of the open sensor, fitted over 20 mm of the dome."""
DOME = '\n[membrane]\nshape = "spherical_cap"\napex_height_mm = 2.0\ndiameter_mm = 26.0\n'


@pytest.fixture(scope="module")
def closed_dome(shared_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("closed") / "session"
    close_session(shared_data / "sensor-K", folder, MM_PER_PX)
    with (folder / "session.toml").open("a") as file:
        file.write(DOME)
    session = read_session(folder)
    assert session.surface == MembraneShape("spherical_cap", 2.0, 26.0)
    write_description(session)
    assert read_session(folder).surface == session.surface
    write_calibration(run_calibration(few(session, 6)).calibration, folder / "closed.gplcal")
    return read_calibration(folder / "closed.gplcal")


@pytest.mark.parametrize(
    ("name", "size_mm"),
    [
        pytest.param("cylinder_s5_d100", 5.0, marks=pytest.mark.long),
        pytest.param("cylinder_s7_d100", 7.0, marks=pytest.mark.long),
        ("cuboid_s6_d100", 6.0),
    ],
)
def test_sizes_and_heights_of_faces_in_a_closed_dome_are_true(
    shared_data, closed_dome, name, size_mm
):
    image = read_image(shared_data / "sensor-K" / "presses" / f"{name}.png")
    pressed = Reconstructor(closed_dome).depth(image, uncertainty=True)
    assert pressed.at_rest == closed_dome.data.in_place.grid.surface
    found = measure(pressed, shape=name.split("_")[0])
    sides = found.side_mm or (found.diameter_mm,)
    # As if it were flat, no face would be found: the dome is 0.15 mm lower beside the middle.
    assert sides == pytest.approx((size_mm,) * len(sides), rel=0.06)
    assert abs(found.size_mm - size_mm) < 2.0 * found.size_sd_mm
    assert found.height_mm == pytest.approx(1.0, rel=0.04)
    assert abs(found.height_mm - 1.0) < 2.0 * found.height_sd_mm
