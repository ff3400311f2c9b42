"""The known data of the virtual sensor, from which a calibration of it starts."""

from __future__ import annotations

import tomllib
from pathlib import Path

from app.program.prepare import virtual_design
from gelpolight_core.session.inventory import SessionInventory
from gelpolight_core.session.session import Session, parse_session
from gelpolight_core.simulation.simulated_session import closed_session_toml, session_toml
from gelpolight_core.simulation.virtual_sensor import VirtualSensor


def virtual_session(*, opens: bool = True) -> Session:
    """Return the session description of the virtual sensor, without a folder.

    Parameters
    ----------
    opens : bool, optional
        Whether the sensor can be opened.
    """
    design = virtual_design()
    content = session_toml(design) if opens else closed_session_toml(VirtualSensor(design))
    usual = {} if opens else {"balls": {"default": 4.0}}
    return parse_session(SessionInventory(Path(), tomllib.loads(content) | usual))
