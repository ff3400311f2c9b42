"""Write ``session.toml``: what a person states of a sensor, its boards and its balls."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import tomli_w

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder, write_atomically
from gelpolight_core.optics.checkerboard import BoardSpec
from gelpolight_core.session.session import FORMAT, VERSION, Session
from gelpolight_core.translation import tr

FILE_NAME = "session.toml"


def write_description(session: Session) -> None:
    """Write a session's description, whole or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    radii: dict[str, float] = dict(session.ball_radii_mm)
    if session.ball_default_radius_mm is not None:
        radii["default"] = session.ball_default_radius_mm
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "sensor": asdict(session.sensor),
        "checkerboard": _board(session.checkerboard),
        "top_pose": _board(session.top_pose),
        "balls": radii,
    }
    if camera := _camera(session):
        content["camera"] = camera
    if session.exposures_ms:
        content["response"] = dict(session.exposures_ms)

    def write(stream: BinaryIO) -> None:
        tomli_w.dump(content, stream)

    write_atomically(session.folder / FILE_NAME, write, inside=session.folder)


def create_session(session: Session) -> None:
    """Make a new session folder with its description; no picture is in it yet.

    Raises
    ------
    InputError
        If the folder already holds a session, or cannot be made.
    """
    path: Path = session.folder / FILE_NAME
    if path.exists():
        raise InputError(
            tr("the folder already holds a session"),
            where=str(session.folder),
            advice=tr("Open it, or choose a new folder"),
        )
    make_folder(session.folder)
    write_description(session)


def _camera(session: Session) -> dict[str, Any]:
    stored, response = session.camera_settings, session.declared_response
    camera = {} if stored is None else stored.as_table()
    if response is not None:
        camera["response" if isinstance(response, str) else "gamma"] = response
    return camera


def _board(board: BoardSpec) -> dict[str, Any]:
    return {"inner_corners": list(board.inner_corners), "square_mm": board.square_mm}
