"""The steps of the wizard: the stages of a recipe, each with its panel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

from app.calibrate.balls import BallsStep
from app.calibrate.boards import LensStep, TopPoseStep
from app.calibrate.illumination import BackgroundStep, RadianceStep
from app.calibrate.image_step import plain_step
from app.calibrate.in_place import InPlaceBallsStep, ScaleStep
from app.calibrate.lights import LightsStep
from app.calibrate.result import ResultStep
from app.calibrate.setup import SetupStep
from app.calibrate.step import Step
from app.calibrate.validation import ValidationStep
from gelpolight_core.calibration import ball_stage, in_place, open_sensor
from gelpolight_core.calibration.recipe import Stage

Route = tuple[type[Step], ...]

FIRST: Route = (SetupStep,)
LAST: Route = (ResultStep, ValidationStep)
"""Steps before and after those of the stages."""
PANELS: Mapping[Stage[Any], Route] = {
    open_sensor.LENS: (LensStep,),
    open_sensor.TOP_POSE: (TopPoseStep,),
    open_sensor.LIGHTS: (LightsStep,),
    open_sensor.RADIANCE: (RadianceStep,),
    open_sensor.BACKGROUND: (BackgroundStep,),
    ball_stage.BALLS: (BallsStep,),
    in_place.BACKGROUND: (BackgroundStep,),
    in_place.SCALE: (ScaleStep,),
    in_place.BALLS: (InPlaceBallsStep,),
}
"""The steps of a stage; another stage with images has one that only captures them."""


def route_of(stages: Iterable[Stage[Any]]) -> Route:
    """Return the route through stages of a recipe: what is known, the stages, and the result."""
    made = [PANELS.get(stage, (plain_step(stage),) if stage.folder else ()) for stage in stages]
    return (*FIRST, *chain.from_iterable(made), *LAST)
