"""A whole session, spoilt: what a person is told, and that nothing else is said."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.calibration.pipeline import calibrate_session
from gelpolight_core.errors import InputError
from gelpolight_core.session.session import read_session


@pytest.fixture
def session(virtual_session: Path, tmp_path: Path) -> Path:
    """Return a copy of the virtual session that may be spoilt."""
    ignored = shutil.ignore_patterns("presses", "truth")
    return Path(shutil.copytree(virtual_session, tmp_path / "session", ignore=ignored))


def test_a_copied_picture_is_refused_whoever_calls(session: Path) -> None:
    shutil.copy(session / "background" / "background.png", session / "whiteboard/whiteboard.png")
    with pytest.raises(InputError, match="copy of"):
        calibrate_session(read_session(session))


def test_a_whiteboard_too_dim_for_the_balls_is_named(session: Path) -> None:
    """A tenth of the light: the board is seen, but hardly where the balls were pressed."""
    path = session / "whiteboard" / "whiteboard.png"
    picture = cv2.imread(str(path))
    assert picture is not None
    cv2.imwrite(str(path), np.round(0.1 * picture).astype(np.uint8))
    with pytest.raises(InputError, match="whiteboard"):
        calibrate_session(read_session(session))
