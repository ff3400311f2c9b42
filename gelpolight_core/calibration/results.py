"""The results of the calibration stages so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import FAR_SHARE, BadPixels
from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.errors import InputError
from gelpolight_core.factors.background import FactorResult
from gelpolight_core.finding import Finding, QualityTable, Verdict, judge, judge_left_out
from gelpolight_core.lights.crosstalk import CrosstalkResult
from gelpolight_core.lights.positions import LightResult
from gelpolight_core.optics.lens import LensResult
from gelpolight_core.optics.pose import TopPoseResult
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.radiance.whiteboard import RadianceResult
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.reflectance.stage import ReflectanceResult
from gelpolight_core.response.stage import ResponseResult
from gelpolight_core.sensor_calibration import FullModel
from gelpolight_core.translation import pattern, tr

Map = NDArray[np.float32]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SeenBall:
    """The result for one image of a ball press.

    Attributes
    ----------
    file : str
        Its name in ``balls``.
    key : str
        Changes with any input of the result.
    image : (rows, columns, 3) float32 or None
        Resampled onto the grid; None if no ball was found.
    press : BallPress or None
        The ball; None if none was found.
    fault : InputError or None
        Why no ball was found.
    """

    file: str
    key: str
    image: Map | None
    press: BallPress | None
    fault: InputError | None


@dataclass(frozen=True, slots=True)
class StageResults:
    """The results of all stages that were run; None for the others."""

    response: ResponseResult | None = None
    lens: LensResult | None = None
    top_pose: TopPoseResult | None = None
    table: ResamplingTable | None = None
    lights: LightResult | None = None
    crosstalk: CrosstalkResult | None = None
    radiance: RadianceResult | None = None
    background: Map | None = None
    bare_membrane: QualityTable | None = None
    bad: BadPixels | None = None
    balls: tuple[SeenBall, ...] = ()
    reflectance: ReflectanceResult | None = None
    factors: FactorResult | None = None
    joint: JointResult | None = None
    full: FullModel | None = None

    @property
    def presses(self) -> tuple[BallPress, ...]:
        """The detected balls."""
        return tuple(ball.press for ball in self.balls if ball.press is not None)

    @property
    def images(self) -> tuple[Map, ...]:
        """Their images, resampled."""
        return tuple(ball.image for ball in self.balls if ball.image is not None)


def require_balls(results: StageResults) -> None:
    """Refuse results without any ball, with the fault of the background or of the first capture."""
    if results.presses:
        return
    bare = results.bare_membrane or QualityTable()
    for figure in bare.figures:
        if figure.verdict is Verdict.FAIL:
            raise InputError(
                tr("No ball was found with this background ({label}: {value:.1f} {unit})").format(
                    label=figure.text, value=figure.value, unit=figure.unit
                ),
                where=tr("background"),
                advice=figure.remedy,
            )
    for ball in results.balls:
        if ball.fault is not None:
            raise ball.fault


def judge_balls(results: StageResults) -> QualityTable:
    """Judge the ball presses together: which captures were left out, and why."""
    refused = [
        pattern(
            "{file}: {found}. {advice}",
            file=ball.file,
            found=ball.fault.found,
            advice=ball.fault.advice,
        )
        for ball in results.balls
        if ball.fault is not None
    ]
    return QualityTable((judge_left_out("balls_left_out", tr("Captures left out"), refused),))


def judge_bad_pixels(bad: BadPixels) -> Finding:
    """Judge how many pixels of the camera do not follow the light."""
    return judge(
        "bad_pixels_percent",
        tr("Dead and hot pixels, left out"),
        100.0 * len(bad.pixels) / max(bad.height * bad.width, 1),
        "%",
        warn=0.5,
        fail=100.0 * FAR_SHARE,
        remedy=tr("Replace the camera, or lower its gain and temperature"),
    )


def need(value: T | None, what: str) -> T:
    """Return a result that another stage uses.

    Parameters
    ----------
    value : object or None
        The result; None if its stage was not run.
    what : str
        Name of the requesting stage, for the message.

    Raises
    ------
    InputError
        If it is missing.
    """
    if value is None:
        raise InputError(
            tr("An earlier stage has no result yet"),
            where=what,
            advice=tr("Complete the earlier stages first"),
        )
    return value
