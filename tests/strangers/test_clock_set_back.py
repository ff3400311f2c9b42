"""The clock is set back while the program runs, or files come from another time."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import ModuleType
from typing import Self

import pytest
from written import calibration

from app.workspace import trash as trash_module
from app.workspace import workspace as workspace_module
from app.workspace.workspace import Workspace
from gelpolight_core.calibration.file import write_calibration

NOW = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC)


class Clock(datetime):
    """A clock that a test sets."""

    shown = NOW

    @classmethod
    def now(cls, tz: object = None) -> Self:
        """Return what it shows."""
        return cls.fromtimestamp(cls.shown.timestamp(), tz or UTC)  # type: ignore[arg-type]


@pytest.fixture
def clock(monkeypatch):
    modules: tuple[ModuleType, ...] = (workspace_module, trash_module)
    for module in modules:
        monkeypatch.setattr(module, "datetime", Clock)
    monkeypatch.setattr(Clock, "shown", NOW)
    return Clock


@pytest.fixture
def workspace(tmp_path):
    return Workspace(tmp_path / "workspace")


def kept(workspace: Workspace, name: str, created: datetime) -> Path:
    """Put a calibration of some time into the library."""
    origin = replace(calibration().provenance, created=created.isoformat())
    path = workspace.calibration_path("T-1", name)
    write_calibration(replace(calibration(), provenance=origin), path)
    return path


def test_two_things_removed_in_the_same_second_can_both_be_put_back(workspace, clock):
    paths = [kept(workspace, name, NOW) for name in ("a", "b")]
    contents = [path.read_bytes() for path in paths]
    removed = [workspace.remove(path) for path in paths]
    clock.shown = NOW - timedelta(hours=1)
    kept(workspace, "c", NOW)
    for removal in removed:
        workspace.restore(removal)
    assert [path.read_bytes() for path in paths] == contents


def test_a_recording_never_takes_the_name_of_one_of_the_same_second(workspace, clock):
    first = workspace.recording_path("A")
    first.write_bytes(b"one")
    workspace.recording_path("A").write_bytes(b"two")
    clock.shown = NOW + timedelta(hours=1)
    workspace.recording_path("A").write_bytes(b"three")
    clock.shown = NOW
    assert not workspace.recording_path("A").exists()
    assert len(list(first.parent.iterdir())) == 3
