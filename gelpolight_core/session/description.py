"""Write ``session.toml``: the description of a sensor, its boards and its balls."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomli_w

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import make_folder, write_text
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.closed import IN_PLACE, ClosedSession
from gelpolight_core.session.session import ELASTOMER, FORMAT, VERSION, Session
from gelpolight_core.translation import tr

FILE_NAME = "session.toml"


def write_description(session: Session | ClosedSession) -> None:
    """Write the description of a session, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    radii: dict[str, float] = dict(session.ball_radii_mm)
    if session.ball_default_radius_mm is not None:
        radii["default"] = session.ball_default_radius_mm
    content: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    content |= _closed(session) if isinstance(session, ClosedSession) else _opened(session)
    if session.elastomer:
        content["sensor"][ELASTOMER] = session.elastomer
    content["balls"] = radii
    if camera := _camera(session):
        content["camera"] = camera

    write_text(session.folder / FILE_NAME, tomli_w.dumps(content), inside=session.folder)


def create_session(session: Session | ClosedSession) -> None:
    """Create a session folder with its description and without images.

    Raises
    ------
    InputError
        If the folder already contains a session, or cannot be created.
    """
    path: Path = session.folder / FILE_NAME
    if path.exists():
        raise InputError(
            tr("The folder already contains a session"),
            where=str(session.folder),
            advice=tr("Open this session, or choose a new folder"),
        )
    make_folder(session.folder)
    write_description(session)


def _opened(session: Session) -> dict[str, Any]:
    content: dict[str, Any] = {
        "sensor": asdict(session.sensor),
        "checkerboard": _board(session.checkerboard),
        "top_pose": _board(session.top_pose),
    }
    if session.exposures_ms:
        content["response"] = dict(session.exposures_ms)
    return content


def _closed(session: ClosedSession) -> dict[str, Any]:
    pressed = session.pressed_scale
    stated = {
        "mm_per_px": session.mm_per_px,
        "mm_per_px_sd": session.mm_per_px_sd,
        "pin_spacing_mm": pressed.pin_spacing_mm,
        "punch_diameter_mm": pressed.punch_diameter_mm,
    }
    return {
        "sensor": {"serial": session.serial},
        IN_PLACE: {key: value for key, value in stated.items() if value is not None},
    }


def _camera(session: Session | ClosedSession) -> dict[str, Any]:
    stored, response = session.camera_settings, session.declared_response
    camera = {} if stored is None else stored.as_table()
    if response is not None:
        camera["response" if isinstance(response, str) else "gamma"] = response
    return camera


def _board(board: BoardSpec) -> dict[str, Any]:
    return {"inner_corners": list(board.inner_corners), "square_mm": board.square_mm}
