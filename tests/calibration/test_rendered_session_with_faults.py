"""A session whose light drifts, of a worn sensor: right numbers, and the true causes."""

import csv
import shutil

import cv2
import numpy as np
import pytest

from gelpolight_core.base.finding import Verdict
from gelpolight_core.base.root_causes import best_cause
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.measurement.object_measurement import measure_object
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_linear_image

PRESS = "cylinder_s5_d100.png"


def change(path, factor, random):
    """Multiply the light of an image (8 bit, linear), and round it as a camera does."""
    light = cv2.imread(str(path)) * factor
    dithered = np.rint(light + random.uniform(-0.5, 0.5, light.shape))
    cv2.imwrite(str(path), np.clip(dithered, 0, 255).astype(np.uint8))


@pytest.mark.long
def test_warming_leds_and_a_worn_spot_leave_a_right_calibration(shared_data, tmp_path):
    folder, random = tmp_path / "sensor-A", np.random.default_rng(0)
    shutil.copytree(shared_data / "sensor-A", folder, ignore=shutil.ignore_patterns("truth*"))
    shutil.copy(shared_data / "sensor-A" / "presses" / "truth.csv", folder / "presses")
    balls = sorted((folder / "balls").iterdir())
    v, u = np.mgrid[:960, :1280]
    spot = 1.0 - 0.6 * (np.hypot(u - 430, v - 600) < 50.0)[..., None]
    change(folder / "background" / "background.png", spot, random)
    change(folder / "presses" / PRESS, spot, random)
    for path, warmth in zip(balls, np.linspace(0.0, 1.0, len(balls)), strict=True):
        change(path, spot * (1.0 + warmth * np.array([0.03, 0.05, 0.08])), random)

    calibration = run_calibration(read_session(folder)).calibration

    assert calibration.verdict is Verdict.WARN
    assert best_cause(calibration.quality).key == "background_light_percent"
    coating = calibration.quality["balls"]["coating_percent"]
    assert (coating.verdict, coating.value > 1.0) == (Verdict.PASS, True)
    image = read_linear_image(folder / "presses" / PRESS)
    measured = measure_object(
        Reconstructor(calibration).depth(image.rgb, uncertainty=True), shape="cylinder"
    )
    with (folder / "presses" / "truth.csv").open() as stream:
        (truth,) = (row for row in csv.DictReader(stream) if row["file"] == PRESS)
    height_mm, diameter_mm = float(truth["height_mm"]), float(truth["diameter_mm"])
    assert measured.height_mm == pytest.approx(height_mm, abs=2.0 * measured.height_sd_mm)
    assert measured.height_mm == pytest.approx(height_mm, rel=0.01)
    assert measured.diameter_mm == pytest.approx(diameter_mm, rel=0.01)
