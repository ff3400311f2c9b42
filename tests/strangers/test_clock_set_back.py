"""The clock is set back while the program runs, or files come from another time."""

from datetime import UTC, datetime, timedelta
from types import ModuleType
from typing import Self

import pytest

from app.program import workspace as workspace_module
from app.program.workspace import Workspace

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
    modules: tuple[ModuleType, ...] = (workspace_module,)
    for module in modules:
        monkeypatch.setattr(module, "datetime", Clock)
    monkeypatch.setattr(Clock, "shown", NOW)
    return Clock


@pytest.fixture
def workspace(tmp_path):
    return Workspace(tmp_path / "workspace")


def test_a_recording_never_takes_the_name_of_one_of_the_same_second(workspace, clock):
    first = workspace.recording_path("A")
    first.write_bytes(b"one")
    workspace.recording_path("A").write_bytes(b"two")
    clock.shown = NOW + timedelta(hours=1)
    workspace.recording_path("A").write_bytes(b"three")
    clock.shown = NOW
    assert not workspace.recording_path("A").exists()
    assert len(list(first.parent.iterdir())) == 3
