"""A new stage is one module and its name in a recipe: everything else follows."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from gelpolight_core.calibration.open_sensor import RESPONSE
from gelpolight_core.calibration.project import Project, calibrate
from gelpolight_core.calibration.recipe import Stage, Work
from gelpolight_core.calibration.recipes import PAPER
from gelpolight_core.calibration.status import StageState
from gelpolight_core.errors import InputError
from gelpolight_core.finding import QualityTable, judge
from gelpolight_core.session.session import read_session


@dataclass(frozen=True, slots=True)
class DarkLevel:
    """Camera signal without light: median of each channel (3,), 0..1, and its figure."""

    level: np.ndarray
    quality: QualityTable


def measure_dark_level(work: Work) -> DarkLevel:
    """Measure the dark level of the camera on images taken with the LEDs off."""
    level = np.median(work.session.averaged(DARK.folder).rgb, axis=(0, 1))
    percent = 100.0 * float(level.max())
    figure = judge("dark_level_percent", "Dark level", percent, "%", warn=0.5, fail=4.0)
    return DarkLevel(level, QualityTable((figure,)))


DARK = Stage(
    "dark",
    "Dark level",
    measure_dark_level,
    (RESPONSE,),
    "dark",
    one_image=True,
    task="Switch the LEDs off.",
)
RECIPE = replace(PAPER, stages=(RESPONSE, DARK, *PAPER.stages[1:]))


def test_a_new_stage_is_computed_judged_and_made_stale(computed_project):
    session = computed_project().session.folder
    with pytest.raises(InputError, match="no images of: dark"):
        calibrate(read_session(session), RECIPE)
    project = Project(session, RECIPE)
    assert project.statuses()["dark"].state is StageState.EMPTY
    size = project.session.images("whiteboard")[0].rgb.shape
    name = project.add_capture("dark", [np.full(size, 1, np.uint8)])
    assert (session / "dark" / name).is_file()
    assert project.stale()[:2] == ("response", "dark")
    project.compute("response")
    status = project.compute("dark")
    assert status.state is StageState.PASS
    assert status.quality["dark_level_percent"].value == pytest.approx(100.0 / 255.0)
    assert project.results[DARK].level.max() == pytest.approx(1.0 / 255.0)
    second = project.add_capture("dark", [np.full(size, 30, np.uint8)])
    assert [path.name for path in project.session.found("dark")] == [second]
    assert project.statuses()["dark"].state is StageState.STALE
    assert project.compute("dark").state is StageState.FAIL
    project.take_back("dark", [second])
    assert [path.name for path in project.session.found("dark")] == [name]
