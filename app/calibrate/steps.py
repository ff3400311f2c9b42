"""The steps of the wizard in their order. A new step is a folder and one line here."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

from app.calibrate.background import BackgroundStep
from app.calibrate.balls import BallsStep
from app.calibrate.closed_balls import ClosedBallsStep
from app.calibrate.lens import LensStep
from app.calibrate.lights import LightsStep
from app.calibrate.radiance import RadianceStep
from app.calibrate.reflectance.presenter import ReflectanceStep
from app.calibrate.refraction import RefractionStep
from app.calibrate.result import ResultStep
from app.calibrate.scale import ScaleStep
from app.calibrate.setup import SetupStep
from app.calibrate.step import StepPresenter
from app.calibrate.step_data import Step
from app.calibrate.top_pose import TopPoseStep
from app.calibrate.validation import ValidationStep
from gelpolight_core.calibration.closed_project import ClosedProject
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject

Route = tuple[type[StepPresenter], ...]

OPEN_ROUTE: Route = (
    SetupStep,
    LensStep,
    TopPoseStep,
    LightsStep,
    RadianceStep,
    BackgroundStep,
    BallsStep,
    RefractionStep,
    ReflectanceStep,
    ResultStep,
    ValidationStep,
)
"""For a sensor that can be opened."""

CLOSED_ROUTE: Route = (
    SetupStep,
    BackgroundStep,
    ScaleStep,
    ClosedBallsStep,
    ResultStep,
    ValidationStep,
)
"""For a sensor whose membrane is bonded: calibrated in place."""


def route_of(project: CalibrationProject | ClosedProject) -> Route:
    """Return the route of a session, without steps for images that it does not need."""
    route = CLOSED_ROUTE if isinstance(project, ClosedProject) else OPEN_ROUTE
    having = (None, *project.statuses())
    return tuple(step for step in route if step.describe().stage in having)


def steps_of(route: Route, having: Container[Stage] | None = None) -> tuple[Step, ...]:
    """Return the data of the steps of a route, with those of their stages that a session has."""
    steps = (presenter.describe() for presenter in route)
    if having is None:
        return tuple(steps)
    return tuple(replace(s, stages=tuple(x for x in s.stages if x in having)) for s in steps)
