"""The known data of the virtual sensor, from which a calibration of it starts."""

from __future__ import annotations

import tomllib
from pathlib import Path

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.session.session import Session, parse_session
from gelpolight_core.simulation.session import closed_session_toml, session_toml
from gelpolight_core.simulation.virtual_sensor import VirtualSensor


def virtual_session(design: SensorDesign | None = None) -> Session:
    """Return the session description of the virtual sensor; it has no folder yet.

    Parameters
    ----------
    design : SensorDesign, optional
        The sensor design; by default the standard one.
    """
    content = tomllib.loads(session_toml(design or SensorDesign()))
    session = parse_session(content, Path("session.toml"))
    return session


def virtual_closed_session(design: SensorDesign | None = None) -> Session:
    """Return the session description of the virtual sensor closed; it has no folder yet.

    Parameters
    ----------
    design : SensorDesign, optional
        The sensor design; by default the standard one.
    """
    content = tomllib.loads(closed_session_toml(VirtualSensor(design or SensorDesign())))
    content["balls"] = {"default": 4.0}
    return parse_session(content, Path("session.toml"))
