"""A non-linear camera gives the same depth as a linear one, if its response is known."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.command_line.main import main
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.open_sensor import LIGHTS, RESPONSE
from gelpolight_core.calibration.project import Run, calibrate
from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.design.parts import Press, SessionDesign
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session

SCALE = 0.3
PRESS = "presses/cylinder_s6_d100.png"
DEFAULT = SensorDesign()

Made = tuple[Path, Run]


def calibrated(folder: Path, response: str, session: SessionDesign, model: str = "full") -> Made:
    """Return a small session of the virtual sensor with another camera, and its calibration."""
    design = replace(
        DEFAULT,
        camera=replace(DEFAULT.camera, response=response),
        balls=DEFAULT.balls[:4],
        presses=(Press("cylinder", 6.0, 1.0, 1.0, -1.0),),
        session=session,
    )
    simulate_session(design, folder / response, scale=SCALE)
    made = read_session(folder / response)
    return folder / response, calibrate(made, recipe_of(made, model))


@pytest.fixture(scope="module")
def linear(tmp_path_factory):
    """Return the session of a linear camera, with an exposure series and single-LED images."""
    asked = SessionDesign(response_pictures=6, single_led=True)
    return calibrated(tmp_path_factory.mktemp("bent"), "linear", asked)


@pytest.fixture(scope="module")
def gamma(tmp_path_factory):
    """Return the session of a camera with a declared gamma of 2.2."""
    return calibrated(tmp_path_factory.mktemp("bent"), "gamma", SessionDesign())


@pytest.fixture(scope="module")
def srgb(tmp_path_factory):
    """Return the session of an sRGB camera whose response is only measured."""
    asked = SessionDesign(declares_response=False, response_pictures=6)
    return calibrated(tmp_path_factory.mktemp("bent"), "srgb", asked, model="paper")


def raw(run: Made) -> np.ndarray:
    """Return the press as delivered by the camera, RGB."""
    return np.ascontiguousarray(cv2.imread(str(run[0] / PRESS))[..., ::-1])


def test_known_camera_settings_are_reported(linear, gamma, srgb):
    for (folder, run), source, left_out, declared in (
        (linear, "measured", True, False),
        (gamma, "declared", False, True),
        (srgb, "measured", False, False),
    ):
        assert run.results[RESPONSE].source == source
        assert (run.calibration.response is None) is left_out
        assert ("[camera]" in (folder / "session.toml").read_text()) is declared
        assert next(iter(run.calibration.quality)) == "response"


@pytest.mark.parametrize("model", ["paper", "full"])
def test_bent_and_straight_cameras_see_the_same_depth(linear, gamma, srgb, model):
    """5 um are half a percent of the press, the error of the full model on matt sensors."""
    straight = Reconstructor(linear[1].calibration, model=model).depth(raw(linear)).depth_mm
    # How the response is known makes no difference to what either model reads.
    for run in (gamma, srgb) if model == "paper" else (gamma,):
        bent = Reconstructor(run[1].calibration, model=model).depth(raw(run)).depth_mm
        assert bent.shape == straight.shape
        assert np.sqrt(np.mean((bent - straight) ** 2)) < 0.005
        top = straight > 0.8
        assert np.median(bent[top]) == pytest.approx(np.median(straight[top]), rel=0.005)


def test_an_unmodelled_gamma_would_be_noticed(gamma):
    """The test above can fail."""
    calibration = gamma[1].calibration
    right = Reconstructor(calibration).depth(raw(gamma)).depth_mm
    wrong = Reconstructor(calibration.changed(response=None)).depth(raw(gamma)).depth_mm
    assert np.sqrt(np.mean((wrong - right) ** 2)) > 0.05


def test_pixel_values_and_read_images_give_the_same_light(gamma):
    folder, run = gamma
    read = read_image(folder / PRESS, response=run.calibration.response).rgb
    for model in ("paper", "full"):
        reconstruct = Reconstructor(run.calibration, model=model)
        from_numbers = reconstruct.depth(raw(gamma)).depth_mm
        np.testing.assert_array_equal(reconstruct.depth(read).depth_mm, from_numbers)
        wide = raw(gamma).astype(np.uint16) * 257
        np.testing.assert_allclose(reconstruct.depth(wide).depth_mm, from_numbers, atol=1e-4)


def test_what_is_saturated_stays_saturated(gamma):
    from gelpolight_core.reconstruction.height_map import Flag

    bright = raw(gamma).copy()
    middle = bright.shape[0] // 2, bright.shape[1] // 2
    bright[middle[0] - 5 : middle[0] + 5, middle[1] - 5 : middle[1] + 5] = 255
    for model in ("paper", "full"):
        flags = Reconstructor(gamma[1].calibration, model=model).depth(bright).flags
        assert ((flags & int(Flag.SATURATED)) != 0).sum() > 25


def test_noise_is_judged_alike(linear, gamma, srgb):
    """Steps of a non-linear scale are up to twice as wide where bright, and finer where dark."""
    straight = linear[1].calibration.noise
    for _, run in (gamma, srgb):
        assert (
            (run.calibration.noise / straight > 0.5) & (run.calibration.noise / straight < 2.0)
        ).all()


def test_the_curve_is_the_camera_s_to_a_third_of_a_percent(srgb):
    found = srgb[1].calibration.response
    encoded = np.linspace(0.0, 1.0, found.curves.shape[1])
    truth = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert np.abs(found.curves - truth).max() < 0.0033


def test_crosstalk_comes_from_single_led_images_if_there_are_any(linear, gamma):
    truth = np.array(DEFAULT.photometry.crosstalk)
    assert linear[1].results[LIGHTS].crosstalk.source == "single_led"
    assert gamma[1].results[LIGHTS].crosstalk.source == "mirror"
    # One grey level in 250 of the brightest pixels.
    assert np.abs(linear[1].calibration.data.crosstalk - truth).max() < 0.002
    assert linear[1].results[LIGHTS].crosstalk.quality["crosstalk_difference_percent"].value < 1.0


def test_commands_undo_the_response(linear, gamma, tmp_path, capsys):
    heights = []
    for number, (folder, run) in enumerate((linear, gamma)):
        path, out = tmp_path / f"{number}.gplcal", tmp_path / str(number)
        write_calibration(run.calibration, path)
        assert main(["reconstruct", str(path), str(folder / PRESS), "-o", str(out)]) == 0
        with np.load(out / f"{Path(PRESS).stem}.npz") as data:
            heights.append(float(np.median(data["depth_mm"][data["depth_mm"] > 0.8])))
        assert main(["inspect", str(path)]) == 0
        times = ["benchmark", str(path), str(folder / PRESS), "--repeats", "1", "--model", "paper"]
        assert main(times) == 0
        shown = capsys.readouterr().out
        assert ("full scale from linear" in shown) is (number == 1)
        assert ("linear light" in shown) is (number == 1)
    assert heights[1] == pytest.approx(heights[0], rel=0.005)
