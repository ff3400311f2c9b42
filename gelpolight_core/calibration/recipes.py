"""The recipes of all kinds of sensor. A new stage is a module, named in a recipe here."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable
from gelpolight_core.image.image_file import names_of
from gelpolight_core.session.inventory import SessionInventory
from gelpolight_core.session.session import SensorData, Session, parse_session

from .closed_sensor_recipe import IN_PLACE
from .joint_stage import JOINT
from .open_ball_stages import BALLS, REFLECTANCE
from .open_sensor_recipe import BACKGROUND, LENS, LIGHTS, RADIANCE, RESPONSE, TOP_POSE
from .recipe import Facts, Recipe, StageResults, shape_facts

if TYPE_CHECKING:
    from gelpolight_core.sensor.sensor_calibration import Calibration, OpenSensor, Provenance


def _facts(c: OpenSensor) -> Facts:
    """Return what is stated of an open sensor."""
    s = c.sensor
    elastomer = f"{s.elastomer_thickness_mm:g} mm, n {s.elastomer_refractive_index:g}"
    window = f"{s.window_thickness_mm:g} mm, n {s.window_refractive_index:g}"
    angle = s.led_half_angle_deg
    return (
        ("Elastomer thickness", elastomer),
        ("Window", window if s.window_thickness_mm > 0.0 else "none"),
        ("LED height Z1", f"{s.led_height_mm:g} mm"),
        *((("LED half angle", f"{angle:g} deg"),) if angle is not None else ()),
        ("Working diameter", f"{s.working_diameter_mm:g} mm"),
        *shape_facts(c.surface),
    )


def _finish(
    session: Session, results: StageResults, quality: dict[str, QualityTable], made: Provenance
) -> Calibration:
    """Return the calibration of an open sensor, with the reflectance curves drawn by the user."""
    from gelpolight_core.sensor.sensor_calibration import Calibration

    from .refinement_stage import sensor_data
    from .reflectance_edit import with_edited_curves

    curves = {
        channel: (np.array([c for c, _ in nodes]), np.array([v for _, v in nodes]))
        for channel, nodes in session.decisions.curves.items()
    }
    joint = results.get(JOINT)
    data = sensor_data(session, results, joint)
    calibration = Calibration("paper" if joint is None else "full", data, quality, made)
    return with_edited_curves(calibration, curves, operator=made.operator, made=made.created)


FULL = Recipe(
    "full",
    "full",
    (RESPONSE, LENS, TOP_POSE, LIGHTS, RADIANCE, BACKGROUND, BALLS, REFLECTANCE, JOINT),
    _finish,
    _facts,
    depends_on=lambda session, inputs: (
        list(inputs.values()),
        session.serial,
        sorted(session.decisions.curves.items()),
    ),
)
"""The full model."""
PAPER = replace(FULL, key="paper", title="paper", stages=FULL.stages[:-1], flat=True)
"""The paper's model."""
RECIPES = (FULL, PAPER, IN_PLACE)
"""The first one that fits a session is used unless another one is asked for."""
OPEN_FOLDERS = frozenset(FULL.own_folders).difference(IN_PLACE.own_folders)
"""Folders of images that need the sensor open."""
TABLES = ("checkerboard", "balls")
"""Tables that session.toml of an open sensor must have, beside ``[sensor]``."""


def recipe_of(session: Session, model: str | None = None) -> Recipe:
    """Return the recipe for a session.

    Parameters
    ----------
    session : Session
        Session of an open or of a closed sensor.
    model : {"full", "paper", "in-place"}, optional
        By default ``in-place`` for a closed sensor and ``full`` for an open one.

    Raises
    ------
    InputError
        If the model does not fit the session.
    """
    for recipe in RECIPES:
        why = recipe.misfit(session)
        if model == recipe.key and why:
            raise InputError(why, f"--model {model}", Remedy.REMOVE_OPTION)
        if model in (None, recipe.key) and not why:
            return recipe
    raise ValueError(f"model = {model!r}")


def recipe_named(model: str) -> Recipe:
    """Return the recipe of a calibration by its model."""
    return next(recipe for recipe in RECIPES if recipe.key == model)


def stage_title(key: str) -> str:
    """Return the title of a stage or of one of its tables. An unknown key is its own title."""
    stages = {stage.key: stage for recipe in RECIPES for stage in recipe.stages}
    tables = {key: table for recipe in RECIPES for key, table in recipe.tables.items()}
    titled = stages.get(key) or tables.get(key)
    return key if titled is None else titled.title


def session_to_calibrate(folder: Path) -> Session:
    """Read a session folder, as :func:`~gelpolight_core.session.session.read_session`.

    Raises
    ------
    InputError
        As there. Where tables and images of an open sensor are missing, one message lists
        everything that is missing and offers the closed route.
    """
    inventory = SessionInventory(folder)
    absent = [name for name in TABLES if name not in inventory.description]
    if absent and not inventory.closed:
        session = Session(folder, SensorData(""), inventory=inventory)
        refuse_missing(session, FULL.missing(session), absent)
    return parse_session(inventory)


def needs_only_open_sensor(session: Session) -> bool:
    """Return whether a session lacks images of an open sensor, and nothing else."""
    missing = FULL.missing(session)
    return bool(missing) and OPEN_FOLDERS.issuperset(missing)


def refuse_missing(
    session: Session, missing: Collection[str], absent_tables: Collection[str] = ()
) -> None:
    """Refuse a session without the images in some folders.

    Raises
    ------
    InputError
        If there are any such folders; it also lists the tables that are absent.
    """
    if not missing:
        return
    message = f"the session has no images of: {', '.join(missing)}"
    if others := [path for name in missing for path in session.inventory.stage(name).others]:
        message += f" ({len(others)} files there are not images: {names_of(others)})"
    if absent_tables:
        tables = ", ".join(f"[{name}]" for name in absent_tables)
        message += f"; session.toml lacks the tables {tables}"
    advice: str = Remedy.CAPTURE_STAGE
    if opened := [name for name in missing if name in OPEN_FOLDERS]:
        message += f"; the sensor must be open for: {', '.join(opened)}"
        advice = (
            "Capture these images; or calibrate in place, from background and balls alone: replace "
            "[checkerboard] and [top_pose] in session.toml with [in_place] mm_per_px = ..."
        )
    if set(missing) == {RADIANCE.folder}:
        advice = "Capture them, or state in [membrane] of session.toml that it is curved"
    raise InputError(message, session.folder, advice)
