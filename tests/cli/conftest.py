"""Shared parts of the command tests."""

from pathlib import Path

import pytest

from app.cli.main import main


@pytest.fixture(autouse=True)
def _no_preferences(tmp_path, monkeypatch):
    """Keep the tests out of the preferences of whoever runs them."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


@pytest.fixture(scope="session")
def session(small_session):
    """Return a session folder of the virtual sensor, at a quarter of the image size."""
    return small_session


@pytest.fixture(scope="session")
def calibration(session, made_once):
    """Return the calibration that the command makes from it."""

    def make(folder: Path) -> Path:
        arguments = ["calibrate", str(session), "-o", str(folder / "c.gplcal"), "--model", "paper"]
        assert main(arguments) == 0
        return folder / "c.gplcal"

    return made_once("command-calibration", make)


@pytest.fixture
def press(session):
    """Return an image of a pressed cylinder."""
    return session / "presses" / "cylinder_s5_d100.png"
