"""Commands name what is wrong with an image, and refuse depth that means nothing."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.cli.main import MENDABLE, main


def changed(path: Path, to: Path, gains: tuple[float, float, float]) -> Path:
    """Write an image with the channels (red, green, blue) of another light; return where."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(to), np.rint(image * np.array(gains[::-1])).clip(0, 255).astype(np.uint8))
    return to


@pytest.fixture
def off(press, tmp_path):
    """Return the press with the green LED off."""
    return changed(press, tmp_path / "off.png", (1.0, 0.0, 1.0))


def test_reconstruct_refuses_images_that_mean_nothing_and_writes_the_others(
    calibration, press, off, tmp_path, capsys
):
    torn, out = tmp_path / "torn.png", tmp_path / "out"
    torn.write_bytes(press.read_bytes()[:-50])
    images = [str(off), str(torn), str(press), str(tmp_path / "none.png")]
    assert main(["reconstruct", str(calibration), *images, "-o", str(out)]) == MENDABLE
    assert [path.name for path in out.iterdir()] == [f"{press.stem}.npz"]
    errors = capsys.readouterr().err
    assert "torn.png: " in errors and "none.png: " in errors
    assert "green LED is off" in errors
    assert "--despite-faults" in errors


@pytest.mark.function("`gelpolight reconstruct --despite-faults`: also of an image with a fault")
def test_reconstruct_goes_on_where_it_is_asked_to(calibration, off, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["reconstruct", str(calibration), str(off), "-o", str(out), "--despite-faults"]
    assert main(arguments) == 0
    assert (out / "off.npz").is_file()
    assert "green LED is off" in capsys.readouterr().err


def test_measure_names_the_image_of_another_sensor(calibration, press, tmp_path, capsys):
    other = tmp_path / "other.png"
    cv2.imwrite(str(other), cv2.imread(str(press), cv2.IMREAD_UNCHANGED)[::-1])
    assert main(["measure", str(calibration), str(other), "--shape", "cylinder"]) == MENDABLE
    errors = capsys.readouterr().err
    assert "looks like this sensor's untouched membrane" in errors
    assert "no object is pressed" not in errors


def test_a_measurement_on_an_image_with_a_fault_is_doubtful_and_lists_it(
    calibration, press, tmp_path
):
    dim = changed(press, tmp_path / "dim.png", (0.98, 0.98, 0.98))
    file = tmp_path / "m.json"
    arguments = ["measure", str(calibration), str(dim), "--shape", "cylinder", "--json", str(file)]
    assert main(arguments) == 0
    found = json.loads(file.read_text())
    assert found["verdict"] == "doubtful"
    # Rounded to whole numbers twice, the image has a little offset as well.
    (fault,) = (fault for fault in found["faults"] if fault["key"] == "exposure")
    assert fault["value"] == pytest.approx(-2.0, abs=0.3)
    assert not fault["depth_is_meaningless"]
