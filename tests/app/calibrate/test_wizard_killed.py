"""The program is killed at any moment: what the technician was told is done is there."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from killing import lines_until_killed
from technician import Technician

from gelpolight_core.calibration.inputs import FOLDERS
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session, read_picture, read_session

FIRST_SEED = int(os.environ.get("GELPOLIGHT_KILL_SEED", "0"))
KILLS = int(os.environ.get("GELPOLIGHT_KILLS", "20"))
LONGEST_S = 0.8
HERE = Path(__file__).parent


def told_until_killed(session: Path, pictures: Path, seed: int) -> list[dict[str, Any]]:
    """Let a wizard work, kill it at a moment that the seed says, and return what it has told."""
    lines = lines_until_killed(
        [str(HERE / "wizard_at_work.py"), str(session), str(pictures), str(seed)],
        paths=(HERE, HERE.parents[2]),
        seed=seed,
        longest_s=LONGEST_S,
        environment={"OMP_NUM_THREADS": "1"},
    )
    return [json.loads(line) for line in lines]


@pytest.mark.parametrize("seed", range(FIRST_SEED, FIRST_SEED + KILLS))
def test_what_was_told_is_there_after_a_kill(
    seed: int, small_session: Path, tmp_path: Path, technician: Technician
) -> None:
    folder = tmp_path / "killed"
    create_session(replace(read_session(small_session), folder=folder, ball_radii_mm={}))
    told = told_until_killed(folder, small_session, seed)
    assert told
    project = CalibrationProject(folder)
    session = project.session
    for item in told:
        if "captured" in item:
            assert read_picture(folder / item["captured"]).size == (320, 240)
            name = Path(item["captured"]).name
            if item["radius_mm"] is not None:
                assert session.ball_radii_mm[name] == item["radius_mm"]
        elif "excluded" in item:
            assert item["excluded"] in session.decisions.excluded
    for name, allowed in may_be_there(told).items():
        assert decided(session, name) in allowed
    for stage in FOLDERS.values():
        for path in session.captured(stage):
            read_picture(path)
    technician.page._show_wizard(project)
    assert technician.wizard.step_list.count() > 0


def may_be_there(told: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Return of all that was decided what may be there: the last decision, or one since begun."""
    allowed: dict[str, list[Any]] = {}
    for item in told:
        if "decided" in item:
            allowed[item["decided"]] = [item["value"]]
        elif item.get("begun") in allowed:
            allowed[item["begun"]].append(item["value"])
    return allowed


def decided(session: Session, name: str) -> list[Any]:
    """Return what the session holds of a decision."""
    if name == "curve":
        return [list(node) for node in session.decisions.curves[0]]
    circle = session.decisions.balls[name]
    return [circle.u_px, circle.v_px, circle.radius_px]
