"""The public interface: its names, their examples, and how quickly it loads."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import gelpolight_core as gp
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.sensor_calibration import Calibration

HEAVY = ("numpy", "scipy", "cv2", "numba", "matplotlib")


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory, small_session: Path, small_calibration: Calibration
) -> Path:
    """Return a folder with the session and the calibration that the examples use."""
    folder = tmp_path_factory.mktemp("public-api")
    (folder / "session").symlink_to(small_session)
    write_calibration(small_calibration, folder / "sensor.gplcal")
    return folder


@pytest.mark.parametrize("name", gp.__all__)
def test_each_public_name_has_an_example_that_runs(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = inspect.getdoc(getattr(gp, name)) or ""
    examples = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert examples.examples
    lines: list[str] = []
    result = doctest.DocTestRunner().run(examples, out=lines.append)
    assert result.failed == 0, "".join(lines)


def test_the_import_loads_nothing_else() -> None:
    code = f"import sys, gelpolight_core; print([m for m in {HEAVY!r} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="mesure"):
        gp.mesure  # noqa: B018
    assert set(gp.__all__) < set(dir(gp))
