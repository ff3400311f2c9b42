"""A new stage is one module and its name in a recipe: the example of CONTRIBUTING.md."""

import sys
import types

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import CalibrationProject, run_calibration
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.session.session import read_session
from tests.docs.chapter import blocks


@pytest.fixture
def example(monkeypatch):
    """Return what the example defines."""
    module = types.ModuleType("example")
    monkeypatch.setitem(sys.modules, module.__name__, module)  # dataclasses look it up
    (block,) = blocks("../CONTRIBUTING.md", "python")
    exec(block.text, module.__dict__)
    return module


@pytest.mark.function("Add a calibration stage as CONTRIBUTING.md says")
def test_a_new_stage_is_computed_judged_and_made_stale(computed_project, example):
    session = computed_project().session.folder
    with pytest.raises(InputError, match="no images of: dark"):
        run_calibration(read_session(session), example.RECIPE)
    project = CalibrationProject(session, example.RECIPE)
    assert project.statuses()["dark"].state is StageState.EMPTY
    size = project.session.images("whiteboard")[0].rgb.shape
    name = project.add_capture("dark", [np.full(size, 1, np.uint8)])
    assert (session / "dark" / name).is_file()
    assert project.stale()[:2] == ("response", "dark")
    project.compute("response")
    status = project.compute("dark")
    assert status.state is StageState.PASS
    assert status.quality["dark_level_percent"].value == pytest.approx(100.0 / 255.0)
    assert project.results[example.DARK].level.max() == pytest.approx(1.0 / 255.0)
    second = project.add_capture("dark", [np.full(size, 30, np.uint8)])
    assert [path.name for path in project.session.found("dark")] == [second]
    assert project.statuses()["dark"].state is StageState.STALE
    assert project.compute("dark").state is StageState.FAIL
    project.undo_capture("dark", [second])
    assert [path.name for path in project.session.found("dark")] == [name]
