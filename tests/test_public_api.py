"""The public interface: its names, their examples, and how quickly it loads."""

import doctest
import inspect
import shutil
import subprocess
import sys

import numpy as np
import pytest

import gelpolight_core as gp
from gelpolight_core.calibration.calibration_file import write_calibration

HEAVY = ("numpy", "scipy", "cv2", "numba", "matplotlib")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, small_session, small_calibration):
    """Return a folder with the session and the calibration that the examples use."""
    folder = tmp_path_factory.mktemp("public-api")
    fewer = shutil.ignore_patterns("view_0[8-9].png", "view_1*.png")
    shutil.copytree(small_session, folder / "session", ignore=fewer)
    write_calibration(small_calibration, folder / "sensor.gplcal")
    return folder


@pytest.mark.function("Run each example of the public API")
@pytest.mark.parametrize("name", gp.__all__)
def test_each_public_name_has_an_example_that_runs(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    text = inspect.getdoc(getattr(gp, name)) or ""
    examples = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert examples.examples
    lines: list[str] = []
    result = doctest.DocTestRunner().run(examples, out=lines.append)
    assert result.failed == 0, "".join(lines)


def test_the_import_loads_nothing_else():
    code = f"import sys, gelpolight_core; print([m for m in {HEAVY!r} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="mesure"):
        gp.mesure  # noqa: B018
    assert set(gp.__all__) < set(dir(gp))


def test_a_fault_of_the_image_is_refused_before_anything_is_measured(
    small_session, small_calibration
):
    image = gp.read_image(small_session / "presses" / "cylinder_s5_d100.png").copy()
    image[..., 0] = 0
    height_map = gp.Reconstructor(small_calibration).depth(image, name="dark.png")
    with pytest.raises(gp.InputError) as refused:
        gp.measure(height_map)
    assert refused.value.found == height_map.health.meaningless.text
    assert refused.value.where == "dark.png"


def test_a_map_that_was_saved_is_trusted_no_more_than_before(
    small_session, small_calibration, tmp_path
):
    image = gp.read_image(small_session / "presses" / "cylinder_s5_d100.png").copy()
    image[20:60, 100:160] = 255  # a reflection beside the object
    height_map = gp.Reconstructor(small_calibration).depth(image, name="a.png", uncertainty=True)
    before = gp.measure(height_map)
    (path,) = gp.write_height_map(height_map, tmp_path, formats="npz")
    after = gp.measure(gp.read_height_map(path))
    assert (before.verdict, after.verdict) == ("doubtful", "doubtful")
    assert after.reason == before.reason
    assert after.sd["diameter_mm"] >= before.sd["diameter_mm"]


def test_floats_from_0_to_255_are_refused(small_session, small_calibration):
    image = gp.read_image(small_session / "presses" / "cylinder_s5_d100.png")
    sensor = gp.Reconstructor(small_calibration)
    with pytest.raises(gp.InputError, match=r"0\.\.1"):
        sensor.depth(image.astype(np.float32) + 1.0)
    assert sensor.depth(image / 255.0).depth_mm.max() > 0.9
