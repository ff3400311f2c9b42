"""Shared parts of the command tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.command_line.main import main


@pytest.fixture(scope="session")
def session(virtual_session: Path) -> Path:
    """Return a session folder of the virtual sensor, at half the image size."""
    return virtual_session


@pytest.fixture(scope="session")
def calibration(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the calibration that the command makes from it."""
    path = tmp_path_factory.mktemp("made") / "c.gplcal"
    assert main(["calibrate", str(session), "-o", str(path), "--model", "paper"]) == 0
    return path


@pytest.fixture
def press(session: Path) -> Path:
    """Return an image of a pressed cylinder."""
    return session / "presses" / "cylinder_s5_d100.png"
