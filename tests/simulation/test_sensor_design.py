"""A design file is read completely, checked, and never guessed."""

import math
from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.simulation.design_parts import MembraneDesign
from gelpolight_core.simulation.sensor_design import SensorDesign, read_design, validate_design

TEXT = """
serial = "bench-7"
[camera]
width_px = 640
distortion = [-0.1, 0.0, 0.0, 0.0]
[layers]
window_thickness_mm = 0
[membrane]
specular_weight = 0.0
[[leds]]
x_mm = 12.0
[[leds]]
x_mm = -6.0
y_mm = 10.4
[[leds]]
x_mm = -6.0
y_mm = -10.4
[[presses]]
shape = "cuboid"
size_mm = 4
yaw_deg = 30.0
"""


def write(folder: Path, text: str) -> Path:
    """Write a design file."""
    path = folder / "design.toml"
    path.write_text(text)
    return path


def test_the_default_design_is_valid():
    assert validate_design(SensorDesign()).leds[0].power == 1.0


def test_values_from_a_file_replace_defaults(tmp_path):
    design = read_design(write(tmp_path, TEXT))
    assert design.serial == "bench-7"
    assert design.camera.width_px == 640
    assert design.camera.height_px == SensorDesign().camera.height_px
    assert design.camera.distortion == (-0.1, 0.0, 0.0, 0.0)
    assert design.layers.window_thickness_mm == 0.0
    assert [led.x_mm for led in design.leds] == [12.0, -6.0, -6.0]
    assert design.presses[0].shape == "cuboid"
    assert design.balls == SensorDesign().balls


@pytest.mark.parametrize(
    "change, named",
    [
        ("[camera]\nfokal = 3", "fokal"),
        ("[lens]\nfx = 3", "lens"),
        ("[camera]\nfx = -2.0", "[camera] fx is -2.0, not a number from 1 to 100000"),
        ("[camera]\nwidth_px = 640.5", "width_px"),
        ("[camera]\nbit_depth = 12", "bit_depth"),
        ('[camera]\nresponse = "log"', "log"),
        ("[camera]\ngamma = 9.0", "gamma"),
        ("[session]\nresponse_pictures = true", "response_pictures"),
        ("[layers]\ntop_distance_mm = 10.0", "layers"),
        ("[membrane]\napex_height_mm = 8.7", "[membrane]"),
        ("[membrane]\napex_height_mm = -0.1", "apex_height_mm"),
        ("[[leds]]\nx_mm = 1.0", "LEDs"),
        ("[[presses]]\nshape = 'pyramid'", "pyramid"),
        ("serial = 7", "serial"),
        ("[camera", "TOML"),
    ],
)
def test_a_fault_is_named(tmp_path, change, named):
    with pytest.raises(InputError) as caught:
        read_design(write(tmp_path, change))
    assert named in str(caught.value)
    assert "design.toml" in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_design(tmp_path / "nothing.toml")


def test_the_hard_design_that_is_shipped_is_as_hard_as_it_says():
    design = read_design(Path(__file__).parents[2] / "resources" / "designs" / "hard.toml")
    signal = 200.0 / 255.0
    noise = (design.camera.shot_variance * signal + design.camera.read_sd**2) ** 0.5
    assert 20.0 * math.log10(signal / noise) == pytest.approx(35.0, abs=0.1)
    for led in design.leds:
        assert math.hypot(led.x_mm, led.y_mm) == pytest.approx(8.5, abs=0.1)
    assert design.layers.elastomer_thickness_mm == 9.0
    assert design.photometry.mirror_peak > 1.0
    rim = 0.5 * design.membrane.working_diameter_mm
    reach = [math.hypot(p.x_mm, p.y_mm) + 0.5 * p.size_mm for p in design.presses]
    assert max(reach) > rim


@pytest.mark.parametrize("apex_mm", [0.05, 2.0, 8.0])
def test_a_curved_membrane_is_a_part_of_one_sphere_over_its_circle(apex_mm):
    membrane = MembraneDesign(working_diameter_mm=26.0, apex_height_mm=apex_mm)
    radius_mm = (13.0**2 + apex_mm**2) / (2.0 * apex_mm)
    away = np.linspace(0.0, 13.0, 27)
    expected = np.sqrt(radius_mm**2 - away**2) - (radius_mm - apex_mm)
    assert membrane.height_mm(away) == pytest.approx(expected, abs=1e-11)
    assert membrane.curvature_per_mm == pytest.approx(1.0 / radius_mm)
    assert not MembraneDesign().height_mm(away).any()
