"""Write ``session.toml``, the description of sensor, boards and balls."""

from __future__ import annotations

from typing import Any

import tomli_w

from gelpolight_core.base.atomic_write import make_folder, write_text
from gelpolight_core.base.codec import pack
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape

from .inventory import DESCRIPTION, IN_PLACE
from .session import (
    FORMAT,
    INDENTERS,
    MEMBRANE,
    VERSION,
    WHITEBOARD,
    Balls,
    ClosedSensorSettings,
    Session,
    serial_fault,
)


def write_description(session: Session) -> None:
    """Write the description of a session, completely or not at all.

    Raises
    ------
    InputError
        If the serial number cannot name files, or the file cannot be written.
    """
    if fault := serial_fault(session.serial):
        raise InputError(f"The serial number {fault}", session.folder, Remedy.CORRECT_VALUE)
    balls = pack(Balls(session.ball_default_radius_mm, session.ball_radii_mm), {}, "")
    content: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    content |= _opened(session) if session.in_place is None else _closed(session, session.in_place)
    content["balls"] = {key: value for key, value in balls.items() if value}
    if camera := _camera(session):
        content["camera"] = camera
    if session.surface.shape != FLAT.shape:
        content[MEMBRANE] = _membrane(session.surface, closed=session.in_place is not None)
    if session.indenters:
        content[INDENTERS] = {name: dict(indenter) for name, indenter in session.indenters.items()}
    write_text(session.folder / DESCRIPTION, tomli_w.dumps(content), inside=session.folder)


def create_session(session: Session) -> None:
    """Create a session folder with its description and without images.

    Raises
    ------
    InputError
        If the folder already contains a session, or cannot be created.
    """
    if (session.folder / DESCRIPTION).exists():
        raise InputError(
            "The folder already contains a session", session.folder, Remedy.CHOOSE_FOLDER
        )
    make_folder(session.folder)
    write_description(session)


def _opened(session: Session) -> dict[str, Any]:
    content: dict[str, Any] = {
        "sensor": pack(session.sensor, {}, ""),
        "checkerboard": pack(session.checkerboard, {}, ""),
        "top_pose": pack(session.top_pose, {}, ""),
    }
    if session.board_reflectance is not None:
        content[WHITEBOARD] = {"reflectance": list(session.board_reflectance)}
    if session.exposures_ms:
        content["response"] = dict(session.exposures_ms)
    return content


def _closed(session: Session, in_place: ClosedSensorSettings) -> dict[str, Any]:
    scale = {} if in_place.mm_per_px is None else {"mm_per_px": in_place.stated_scale}
    return {"sensor": {"serial": session.serial}, IN_PLACE: pack(in_place, {}, "") | scale}


def _membrane(surface: MembraneShape, *, closed: bool) -> dict[str, Any]:
    wide = {"diameter_mm": surface.diameter_mm} if closed else {}
    where = {"file": surface.file} if surface.file else {"apex_height_mm": surface.apex_height_mm}
    return {"shape": surface.shape, **where, **wide}


def _camera(session: Session) -> dict[str, Any]:
    stored, response = session.camera_settings, session.declared_response
    camera = {} if stored is None else pack(stored, {}, "")
    if response is not None:
        camera["response" if isinstance(response, str) else "gamma"] = response
    return camera
