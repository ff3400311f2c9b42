"""A non-linear camera gives the same depth as a linear one, if its response is known."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.cli.main import main
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS, RESPONSE
from gelpolight_core.calibration.project import CalibrationRun, run_calibration, run_stage
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation.design_parts import SessionDesign
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.session_plan import exposure_series, response_tables
from gelpolight_core.simulation.virtual_sensor import VirtualSensor, Whiteboard

PRESS = "presses/cylinder_s5_d100.png"
GAMMA = 2.2
DEFAULT = SensorDesign().scaled(0.25)


def srgb(light: np.ndarray) -> np.ndarray:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def encoded(path: Path, encode) -> np.ndarray:
    """Return an image of the linear camera, BGR or grey, as another camera delivers it."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    full = np.iinfo(image.dtype).max
    return np.rint(full * encode(image / full)).astype(image.dtype)


@pytest.fixture(scope="module")
def linear(small_session, small_run):
    """Return the session of a linear camera."""
    return small_session, small_run


@pytest.fixture(scope="module")
def gamma(small_session, tmp_path_factory):
    """Return the same session by a camera with a declared gamma."""
    folder = tmp_path_factory.mktemp("bent") / "gamma"
    shutil.copytree(small_session, folder)
    for path in folder.glob("*/*.png"):
        cv2.imwrite(str(path), encoded(path, lambda light: light ** (1 / GAMMA)))
    with (folder / "session.toml").open("a") as file:
        file.write(f"\n[camera]\ngamma = {GAMMA}\n")
    return folder, run_calibration(read_session(folder))


@pytest.fixture(scope="module")
def measured(small_session, tmp_path_factory):
    """Return what the series of an sRGB camera shows, which declares nothing."""
    folder = tmp_path_factory.mktemp("bent") / "srgb"
    design = replace(
        DEFAULT,
        camera=replace(DEFAULT.camera, response="srgb"),
        session=SessionDesign(declares_response=False, response_pictures=6),
    )
    sensor = VirtualSensor(design, 0)
    (folder / "response").mkdir(parents=True)
    text = (small_session / "session.toml").read_text() + response_tables(design)
    (folder / "session.toml").write_text(text)
    for name, exposure in exposure_series(design).items():
        frame = sensor.frame(Whiteboard(exposure=exposure), averaged=1, stream=name)
        cv2.imwrite(str(folder / "response" / name), frame[..., ::-1])
    return run_stage(FULL, FULL.stages[0], read_session(folder), StageResults())[RESPONSE]


def raw(run: tuple[Path, CalibrationRun]) -> np.ndarray:
    """Return the press as delivered by the camera, RGB."""
    return np.ascontiguousarray(cv2.imread(str(run[0] / PRESS))[..., ::-1])


def test_known_camera_settings_are_reported(gamma, measured):
    assert gamma[1].results[RESPONSE].source == "declared"
    assert next(iter(gamma[1].calibration.quality)) == "response"
    assert measured.source == "measured"


@pytest.mark.function("Correct a camera that is not linear, by its response")
@pytest.mark.parametrize("model", ["paper", "full"])
def test_bent_and_straight_cameras_see_the_same_depth(linear, gamma, model):
    """5 um are half a percent of the press, the error of the full model on matt sensors."""
    straight = Reconstructor(linear[1].calibration, model=model).depth(raw(linear)).depth_mm
    bent = Reconstructor(gamma[1].calibration, model=model).depth(raw(gamma)).depth_mm
    assert bent.shape == straight.shape
    assert np.sqrt(np.mean((bent - straight) ** 2)) < 0.005
    top = straight > 0.8
    assert np.median(bent[top]) == pytest.approx(np.median(straight[top]), rel=0.005)


def test_how_the_response_is_known_makes_no_difference(linear, measured):
    folder, run = linear
    known = run.calibration.changed(response=CameraResponse(measured.response.curves))
    image = np.ascontiguousarray(encoded(folder / PRESS, srgb)[..., ::-1])
    bent = Reconstructor(known, model="paper").depth(image).depth_mm
    straight = Reconstructor(run.calibration, model="paper").depth(raw(linear)).depth_mm
    assert np.sqrt(np.mean((bent - straight) ** 2)) < 0.005


def test_an_unmodelled_gamma_would_be_noticed(gamma):
    """The test above can fail."""
    calibration = gamma[1].calibration
    right = Reconstructor(calibration).depth(raw(gamma)).depth_mm
    wrong = Reconstructor(calibration.changed(response=None)).depth(raw(gamma)).depth_mm
    assert np.sqrt(np.mean((wrong - right) ** 2)) > 0.05


def test_pixel_values_and_read_images_give_the_same_light(gamma):
    folder, run = gamma
    read = read_linear_image(folder / PRESS, response=run.calibration.response).rgb
    for model in ("paper", "full"):
        reconstruct = Reconstructor(run.calibration, model=model)
        from_numbers = reconstruct.depth(raw(gamma)).depth_mm
        np.testing.assert_array_equal(reconstruct.depth(read).depth_mm, from_numbers)
        wide = raw(gamma).astype(np.uint16) * 257
        np.testing.assert_allclose(reconstruct.depth(wide).depth_mm, from_numbers, atol=1e-4)


def test_noise_is_judged_alike(linear, gamma):
    """Steps of a non-linear scale are up to twice as wide where bright, and finer where dark."""
    times = gamma[1].calibration.noise / linear[1].calibration.noise
    assert ((times > 0.5) & (times < 2.0)).all()


def test_the_curve_is_the_camera_s_to_a_third_of_a_percent(measured):
    code = np.linspace(0.0, 1.0, measured.response.curves.shape[1])
    truth = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    assert np.abs(measured.response.curves - truth).max() < 0.0033


@pytest.mark.function("Correct light of one LED in another LED's channel")
def test_crosstalk_comes_from_single_led_images_if_there_are_any(linear, tmp_path):
    folder, run = linear
    single = tmp_path / "single_led"
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    single.mkdir()
    sensor = VirtualSensor(DEFAULT, 0)
    for led, name in enumerate(("red", "green", "blue")):
        frame = sensor.frame(Whiteboard(led=led), averaged=8, stream=name)
        cv2.imwrite(str(single / f"{name}.png"), frame[..., ::-1])
    found = run_stage(FULL, LIGHTS, read_session(tmp_path), run.results)[LIGHTS].crosstalk
    assert found.source == "single_led"
    assert run.results[LIGHTS].crosstalk.source == "mirror"
    # One grey level in 250 of the brightest pixels.
    assert np.abs(found.matrix - np.array(DEFAULT.photometry.crosstalk)).max() < 0.002


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
