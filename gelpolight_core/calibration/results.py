"""What the stages of a calibration have come to so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import FullModel
from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult
from gelpolight_core.lights.crosstalk import CrosstalkResult
from gelpolight_core.lights.positions import LightResult
from gelpolight_core.optics.lens import LensResult
from gelpolight_core.optics.pose import TopPoseResult
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.radiance.whiteboard import RadianceResult
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.reflectance.stage import ReflectanceResult
from gelpolight_core.response.stage import ResponseResult
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SeenBall:
    """What was made of one picture of a ball press.

    Attributes
    ----------
    file : str
        Its name in ``balls``.
    key : str
        Changes with anything that the finding rests on.
    picture : (rows, columns, 3) float32
        Resampled onto the grid.
    press : BallPress or None
        The ball; None where none was found.
    fault : InputError or None
        Why not.
    """

    file: str
    key: str
    picture: Map
    press: BallPress | None
    fault: InputError | None


@dataclass(frozen=True, slots=True)
class StageResults:
    """The results of all stages that were run; None where a stage was not."""

    response: ResponseResult | None = None
    lens: LensResult | None = None
    top_pose: TopPoseResult | None = None
    table: ResamplingTable | None = None
    lights: LightResult | None = None
    crosstalk: CrosstalkResult | None = None
    radiance: RadianceResult | None = None
    background: Map | None = None
    balls: tuple[SeenBall, ...] = ()
    reflectance: ReflectanceResult | None = None
    factors: FactorResult | None = None
    joint: JointResult | None = None
    full: FullModel | None = None

    @property
    def presses(self) -> tuple[BallPress, ...]:
        """The balls that were found."""
        return tuple(ball.press for ball in self.balls if ball.press is not None)

    @property
    def pictures(self) -> tuple[Map, ...]:
        """Their pictures, resampled."""
        return tuple(ball.picture for ball in self.balls if ball.press is not None)


def require_balls(results: StageResults) -> None:
    """Raise the fault of the first picture in which no ball was found."""
    for ball in results.balls:
        if ball.fault is not None:
            raise ball.fault


def need(value: T | None, what: str) -> T:
    """Return a result that another stage builds on.

    Parameters
    ----------
    value : object or None
        The result; None where its stage was not run.
    what : str
        Who asks, for the message.

    Raises
    ------
    InputError
        If it is missing.
    """
    if value is None:
        raise InputError(
            tr("an earlier stage has no result yet"),
            where=what,
            advice=tr("Complete the earlier stages first"),
        )
    return value
