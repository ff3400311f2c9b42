"""One wrong number of the set-up moves many figures: the number itself is named first."""

import re
import shutil

import pytest

from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.base.root_causes import best_cause
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS, TOP_POSE
from gelpolight_core.calibration.project import assemble, run_stage
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.session.session import read_session


@pytest.mark.function("See the most likely cause where several figures are poor")
@pytest.mark.parametrize(
    ("cause", "first", "number", "factor"),
    [
        ("ball_radius", BALLS, r"(default = |\.png\" = )([\d.]+)", 2.0),
        *(
            pytest.param(*row, marks=pytest.mark.long)
            for row in (
                ("led_height", LIGHTS, r"(led_height_mm = )([\d.]+)", 5.0 / 13.7),
                ("thickness", TOP_POSE, r"(elastomer_thickness_mm = )([\d.]+)", 0.5),
                ("working_diameter", TOP_POSE, r"(diameter_mm = )([\d.]+)", 40.0 / 26.0),
                ("refractive_index", TOP_POSE, r"(elastomer_r\w+ = )([\d.]+)", 1.0 / 1.41),
            )
        ),
    ],
)
def test_the_number_that_is_wrong_is_the_first_cause(
    small_project, tmp_path, cause, first, number, factor
):
    folder = tmp_path / "session"
    shutil.copytree(small_project.session.folder, folder)
    for ball in sorted((folder / "balls").iterdir())[3:]:
        ball.unlink()
    path = folder / "session.toml"
    text, count = re.subn(number, lambda m: f"{m[1]}{float(m[2]) * factor:.4f}", path.read_text())
    assert count
    path.write_text(text)
    session, results = read_session(folder), small_project.results
    for stage in FULL.stages[FULL.stages.index(first) :]:
        results = run_stage(FULL, stage, session, results)
    found = best_cause(assemble(FULL, session, results).calibration.quality)
    assert found.key == cause


def test_findings_that_two_causes_explain_equally_well_name_none():
    poor = [
        judge(key, key, 2.0, warn=1.0) for key in ("ball_height_error_percent", "depth_sd_percent")
    ]
    assert best_cause({"joint": QualityTable(tuple(poor))}) is None
