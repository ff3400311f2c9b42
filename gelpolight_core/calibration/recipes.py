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
    led_facts,
    linear,
)
from gelpolight_core.calibration.recipe import Facts, Recipe, Results, Stage, Work, shape_facts
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import QualityTable

if TYPE_CHECKING:
    from gelpolight_core.calibration.refinement import Joint
    from gelpolight_core.sensor_calibration import Calibration, OpenSensor, Provenance
    from gelpolight_core.session.session import Session


def _run_joint(work: Work) -> Joint:
    from gelpolight_core.calibration.refinement import refine

    return refine(linear(work.session, work.results), work.results)


def _joint_facts(c: OpenSensor) -> Facts:
    full = c.full
    if full is None:
        return ()
    membrane, (before, after) = full.membrane, full.held_out
    compared = before > 0.0  # otherwise no press was held out, and no loss measured
    kept = {
        "refined": "refined: they fit held-out presses better",
        "mirror": "from the mirror: refinement did not improve held-out presses"
        if compared
        else "from the mirror: there were too few presses to leave any out",
    }.get(full.kept, full.kept)
    loss = "{before:.3g} with the LEDs from the mirror, {after:.3g} refined"
    parameters = (
        f"gloss {membrane.gloss:.3f}, roughness {membrane.roughness:.3f}, "
        f"interreflection {membrane.interreflection:.3f}"
    )
    moved_mm = full.led_positions_mm - c.led_positions_mm
    shifts = ["{:+.3f}, {:+.3f}, {:+.3f} mm".format(*moved) for moved in moved_mm.tolist()]
    leds = led_facts(full.led_positions_mm, full.led_sd_mm)
    facts = (
        ("LEDs used", kept),
        *(
            (name, f"{led}, shifted by {shift}")
            for (name, led), shift in zip(leds, shifts, strict=True)
        ),
        (f"Membrane ({full.membrane_kept})", parameters),
        ("Loss on held-out presses", loss.format(before=before, after=after)),
    )
    return facts if compared else facts[:-1]


JOINT = Stage(
    "joint",
    "Joint refinement",
    _run_joint,
    (REFLECTANCE,),
    share=15,
    about="Fits LEDs, membrane and balls together to all ball presses",
    facts=_joint_facts,
)


def _facts(c: OpenSensor) -> Facts:
    """Return what is stated of an open sensor."""
    s = c.sensor
    elastomer = f"{s.elastomer_thickness_mm:g} mm, n {s.elastomer_refractive_index:g}"
    window = f"{s.window_thickness_mm:g} mm, n {s.window_refractive_index:g}"
    return (
        ("Elastomer thickness", elastomer),
        ("Window", window if s.window_thickness_mm > 0.0 else "none"),
        ("LED height Z1", f"{s.led_height_mm:g} mm"),
        ("Working diameter", f"{s.working_diameter_mm:g} mm"),
        *shape_facts(c.surface),
    )


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
    """Return the name of a stage or of one of its tables; an unknown one is shown by its key."""
    stages = {stage.key: stage for recipe in RECIPES for stage in recipe.stages}
    tables = {key: table for recipe in RECIPES for key, table in recipe.tables.items()}
    found = stages.get(key) or tables.get(key)
    return key if found is None else found.title
