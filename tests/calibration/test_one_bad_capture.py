"""A capture that cannot be used is left out with its reason; the others are used without it."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.calibrate.ball_steps import judge_ball
from app.calibrate.board_steps import judge_top_view, judge_view
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.calibration.open_sensor_recipe import LENS
from gelpolight_core.calibration.stage_status import StageState

SEVERAL = ("lens", "top_pose", "balls")


def write_noise(path: Path, size: tuple[int, int]) -> None:
    """Write a colour image that shows nothing."""
    noise = np.random.default_rng(5).normal(90.0, 4.0, (size[1], size[0], 3))
    assert cv2.imwrite(str(path), np.clip(noise, 0, 255).astype(np.uint8))


def spoil(folder: Path, usual: tuple[int, int]) -> dict[str, str]:
    """Add one unreadable image, one of another size, and one that shows nothing."""
    (folder / "zz_damaged.png").write_bytes(b"not an image")
    write_noise(folder / "zz_small.png", (usual[0] // 2, usual[1] // 2))
    write_noise(folder / "zz_nothing.png", usual)
    return {"zz_damaged.png": "not an image", "zz_small.png": "pixels", "zz_nothing.png": ""}


@pytest.mark.parametrize("stage", SEVERAL)
def test_bad_captures_are_named_on_their_thumbnails_and_the_stage_goes_on(stage, computed_project):
    project = computed_project()
    folder = project.session.folder / project.recipe[stage].folder
    camera = project.results[LENS].camera if project.results.get(LENS) else None
    reasons = spoil(folder, (camera.width, camera.height))
    if stage == "balls":
        for name in reasons:
            project.set_ball_radius(name, 3.0)
    status = project.compute(stage)
    assert status.state is StageState.WARN, status.sentence
    (left_out,) = [f for f in status.quality.figures if f.key.endswith("left_out")]
    assert left_out.value == len(reasons)
    lens = project.results.get(LENS)
    views = {view.name: view for view in lens.views}
    judges: dict[str, Callable[[str], Finding | None]] = {
        "lens": lambda name: judge_view(views.get(name)),
        "top_pose": lambda name: judge_top_view(name, project, status),
        "balls": lambda name: judge_ball(name, project),
    }
    for path in project.session.found(project.recipe[stage].folder):
        finding = judges[stage](path.name)
        assert (finding.verdict is Verdict.FAIL) is (path.name in reasons)
        if path.name in reasons:
            assert reasons[path.name] in finding.sentence
            assert path.name in left_out.remedy
