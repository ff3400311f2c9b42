"""The recipes of all kinds of sensor. A new stage is a module, and its name in a recipe here."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gelpolight_core.calibration.ball_stage import BALLS, REFLECTANCE
from gelpolight_core.calibration.in_place import IN_PLACE
from gelpolight_core.calibration.open_sensor import (
    BACKGROUND,
    LENS,
    LIGHTS,
    RADIANCE,
    RESPONSE,
    TOP_POSE,
    linear,
)
from gelpolight_core.calibration.recipe import Recipe, Results, Stage, Work
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import QualityTable
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from gelpolight_core.calibration.refinement import Joint
    from gelpolight_core.sensor_calibration import Calibration, Provenance
    from gelpolight_core.session.session import Session


def _run_joint(work: Work) -> Joint:
    from gelpolight_core.calibration.refinement import refine

    return refine(linear(work.session, work.results), work.results)


JOINT = Stage("joint", tr("Joint refinement"), _run_joint, (REFLECTANCE,), share=15)


def _finish(
    session: Session, results: Results, quality: dict[str, QualityTable], made: Provenance
) -> Calibration:
    """Return the calibration of an open sensor, with the reflectance curves drawn by the user."""
    from gelpolight_core.calibration.edit import edited
    from gelpolight_core.calibration.refinement import sensor_data
    from gelpolight_core.sensor_calibration import Calibration

    curves = {
        channel: (np.array([c for c, _ in nodes]), np.array([v for _, v in nodes]))
        for channel, nodes in session.decisions.curves.items()
    }
    joint = results.get(JOINT)
    data = sensor_data(session, results, joint)
    calibration = Calibration("paper" if joint is None else "full", data, quality, made)
    return edited(calibration, curves, operator=made.operator, made=made.created)


FULL = Recipe(
    "full",
    (RESPONSE, LENS, TOP_POSE, LIGHTS, RADIANCE, BACKGROUND, BALLS, REFLECTANCE, JOINT),
    _finish,
    depends_on=lambda session, inputs: (
        list(inputs.values()),
        session.serial,
        sorted(session.decisions.curves.items()),
    ),
)
"""The full model."""
PAPER = replace(FULL, key="paper", stages=FULL.stages[:-1])
"""The paper's model."""
RECIPES = (FULL, PAPER, IN_PLACE)
"""The first one that fits a session is used unless another one is asked for."""


def recipe_of(session: Session, model: str | None = None) -> Recipe:
    """Return the recipe for a session.

    Parameters
    ----------
    session : Session
        Of an open or of a closed sensor.
    model : {"full", "paper", "in-place"}, optional
        By default ``in-place`` for a closed sensor and ``full`` for an open one.

    Raises
    ------
    InputError
        If the model does not fit the session.
    """
    for recipe in RECIPES:
        if recipe.fits(session) and model in (None, recipe.key):
            return recipe
    raise InputError(
        tr("The session has no table [in_place]")
        if session.in_place is None
        else tr("The session is of a closed sensor"),
        where=f"--model {model}",
        advice=Remedy.REMOVE_OPTION,
    )


def stage_title(key: str) -> str:
    """Return the name of a stage or of one of its tables; an unknown one is shown by its key."""
    stages = [stage for recipe in RECIPES for stage in recipe.stages]
    titles = {table.key: table.title for stage in stages for table in stage.all_tables}
    return {**titles, **{stage.key: stage.title for stage in stages}}.get(key, key)
