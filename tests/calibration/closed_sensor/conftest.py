"""A closed sensor: the virtual one, of which only background and balls are kept."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.session.session import Session, read_session

MadeOnce = Callable[[str, Callable[[Path], Any]], Any]
MM_PER_PX = 0.0989
"""Apparent distance of the design's membrane over its focal length, at a quarter of its size."""


def few(session: Session, count: int = 5) -> Session:
    """Return a session of which only the first balls are used."""
    others = frozenset(f"balls/{path.name}" for path in session.files("balls")[count:])
    return replace(session, decisions=replace(session.decisions, excluded=others))


def close_session(opened: Path, folder: Path, mm_per_px: float) -> Path:
    """Copy what a closed sensor's owner has of a session, and describe it so."""
    folder.mkdir()
    for stage in ("background", "balls"):
        shutil.copytree(opened / stage, folder / stage)
    session = read_session(opened)
    radii = [
        f'"{path.name}" = {session.ball_radius_mm(path.name)}' for path in session.files("balls")
    ]
    (folder / "session.toml").write_text(
        "\n".join(
            [
                'format = "gelpolight-session"',
                "version = 1",
                "[sensor]",
                'serial = "closed-1"',
                "[in_place]",
                f"mm_per_px = {mm_per_px:.6f}",
                "mm_per_px_sd = 0.0001",
                "[balls]",
                *radii,
                "",
            ]
        )
    )
    return folder


@pytest.fixture(scope="session")
def closed_folder(small_session_of_ten_balls, made_once):
    """Return a closed sensor's session folder."""

    def make(folder: Path) -> Path:
        return close_session(small_session_of_ten_balls, folder / "session", MM_PER_PX)

    return made_once("closed-session", make)


@pytest.fixture(scope="session")
def closed_session(closed_folder):
    """Return the closed sensor's session."""
    session = read_session(closed_folder)
    return session


@pytest.fixture(scope="session")
def closed_run(closed_session, made_once):
    """Return the closed sensor's calibration with its presses; not to be changed."""
    return made_once("closed-run", lambda _: run_calibration(closed_session))
