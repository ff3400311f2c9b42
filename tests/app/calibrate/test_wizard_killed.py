"""After a kill at any moment, everything that was reported as done is on disk."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from killing import Forks

from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.session.description import create_session
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session, read_session

FIRST_SEED = int(os.environ.get("GELPOLIGHT_KILL_SEED", "0"))
KILLS = int(os.environ.get("GELPOLIGHT_KILLS", "2"))
LONGEST_S = 0.8
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def wizards():
    """Return a process with the program loaded, to be forked and killed."""
    # A fork copies only one thread.
    alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with Forks("wizard_at_work", (HERE, HERE.parents[2]), alone) as forks:
        yield forks


@pytest.mark.parametrize("seed", range(FIRST_SEED, FIRST_SEED + KILLS))
def test_reported_work_survives_a_kill(seed, wizards, small_session, tmp_path, technician):
    folder = tmp_path / "killed"
    create_session(replace(read_session(small_session), folder=folder, ball_radii_mm={}))
    arguments = [str(folder), str(small_session), str(seed)]
    lines = wizards.lines_until_killed(arguments, tmp_path, seed=seed, longest_s=LONGEST_S)
    reported: list[dict[str, Any]] = [json.loads(line) for line in lines]
    assert reported
    project = Project(folder)
    session = project.session
    for item in reported:
        if "captured" in item:
            assert read_image(folder / item["captured"]).size == (320, 240)
            name = Path(item["captured"]).name
            if item["radius_mm"] is not None:
                assert session.ball_radii_mm[name] == item["radius_mm"]
        elif "excluded" in item:
            assert item["excluded"] in session.decisions.excluded
    for name, allowed in may_be_there(reported).items():
        assert decided(session, name) in allowed
    for stage in FULL.folders(session):
        for path in session.captured(stage):
            read_image(path)
    technician.page._show_wizard(project)
    assert technician.wizard.step_list.count() > 0


def may_be_there(reported: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Return the possible decisions after a kill: the last one, or one started since."""
    allowed: dict[str, list[Any]] = {}
    for item in reported:
        if "decided" in item:
            allowed[item["decided"]] = [item["value"]]
        elif item.get("begun") in allowed:
            allowed[item["begun"]].append(item["value"])
    return allowed


def decided(session: Session, name: str) -> list[Any]:
    """Return the session's value of a decision."""
    if name == "curve":
        return [list(node) for node in session.decisions.curves[0]]
    circle = session.decisions.balls[name]
    return [circle.u_px, circle.v_px, circle.radius_px]
