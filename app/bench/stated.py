"""What the maker of the virtual sensor states of it: where a calibration of it starts from."""

from __future__ import annotations

import tomllib
from pathlib import Path

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.session.session import Session, parse_session
from gelpolight_core.simulation.session import session_toml


def stated_session(design: SensorDesign | None = None) -> Session:
    """Return the description of the virtual sensor's session; it has no folder yet.

    Parameters
    ----------
    design : SensorDesign, optional
        The sensor; the standard one without it.
    """
    content = tomllib.loads(session_toml(design or SensorDesign()))
    session = parse_session(content, Path("session.toml"))
    return session
