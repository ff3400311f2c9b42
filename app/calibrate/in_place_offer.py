"""A folder without the images of an open sensor, as the start of a closed sensor's session."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from app.calibrate.setup_values import new_session
from gelpolight_core.calibration.missing import needs_only_open_sensor
from gelpolight_core.calibration.project import Project
from gelpolight_core.errors import InputError
from gelpolight_core.session.session import (
    IN_PLACE,
    SensorData,
    Session,
    parse_radii,
    read_description,
)
from gelpolight_core.session.table import Table


def in_place_offer(folder: Path) -> Session | None:
    """Return what a folder states for a closed sensor's session, with the folder of its images.

    None if it has no background and ball presses, if nothing of an open sensor is missing, or if
    its description is damaged or already that of a closed sensor.
    """
    offer = replace(new_session(optics=False), folder=folder)
    path = folder / "session.toml"
    if not needs_only_open_sensor(offer):
        return None
    try:
        content = read_description(folder) if path.exists() else {}
    except InputError:
        return None
    if IN_PLACE in content:
        return None
    try:
        top = Table(content, "", path)
        serial = top.table("sensor").text("serial")
        radii, default = parse_radii(top.table("balls"))
    except InputError:
        return offer  # the form asks for what the folder does not state
    usual = default or offer.ball_default_radius_mm
    return replace(
        offer, sensor=SensorData(serial), ball_radii_mm=radii, ball_default_radius_mm=usual
    )


def copy_images(offer: Session, project: Project) -> None:
    """Copy background and ball presses of an offer, with their radii, into a new session.

    Raises
    ------
    InputError
        If an image cannot be used.
    """
    project.import_files("background", offer.found("background"))
    by_radius: dict[float, list[Path]] = {}
    for path in offer.found("balls"):
        by_radius.setdefault(offer.ball_radius_mm(path.name), []).append(path)
    for radius_mm, files in by_radius.items():
        project.import_files("balls", files, radius_mm=radius_mm)
