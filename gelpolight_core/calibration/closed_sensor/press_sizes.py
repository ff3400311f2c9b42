"""Find the ball press whose stated diameter contradicts the other presses, and what fits them.

A wrong diameter also disturbs the fit to all presses, so that others look wrong. The presses that
look worst are therefore compared with a fit without them, and its scatter gives the limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np
from scipy.special import stdtrit

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.sensor.closed_sensor.colour_change import ColourChange
from gelpolight_core.sensor.closed_sensor.slope_model import InPlaceModel

from .ball_contact import BallContact
from .held_out import HeldOutPress, held_out_press, held_out_slope_ratios
from .press_light_change import BallImage, press_lights
from .ridge_fit import (
    FIRST_RIDGE,
    PressNormalEquations,
    choose_ridge,
    leave_one_out_fits,
    press_sums,
    solve_ridge,
    squared_loss,
)
from .slope_calibration import InPlaceResult, contact_in

FALSE_ALARMS = 0.05
"""Share of correct calibrations in which the size of a ball is doubted."""
LEAST_OTHERS = 3
"""With fewer others, it is unknown which of two different presses is wrong."""


@dataclass(frozen=True, slots=True)
class PressSize:
    """Size of the ball of one press, as stated and as it fits the other presses.

    Attributes
    ----------
    name : str
        The image's file.
    stated_mm, fitted_mm : float
        Diameter of the ball.
    proposed_mm : float
        The nearest diameter that is stated for another press, if it fits as well; else as fitted,
        with two digits.
    limit : float
        Logarithm of fitted over stated that presses of the right size exceed by chance only.
    """

    name: str
    stated_mm: float
    fitted_mm: float
    proposed_mm: float
    limit: float

    @property
    def excess(self) -> float:
        """Difference of fitted and stated diameter over its limit."""
        return abs(math.log(self.fitted_mm / self.stated_mm)) / self.limit

    @property
    def remedy(self) -> str:
        """The size that fits, without a full stop; empty if the stated one does."""
        if self.excess <= 1.0:
            return ""
        return f"{PurePath(self.name).stem}: the other presses fit {self.proposed_mm:.3g} mm"

    @property
    def figure(self) -> Finding:
        """The difference as a figure."""
        return judge(
            "press_radius_percent",
            f"Stated diameter against the other presses, worst ({self.name})",
            100.0 * math.expm1(self.excess * self.limit),
            "%",
            warn=100.0 * math.expm1(self.limit),
            remedy=self.remedy,
        )


@dataclass(frozen=True, slots=True)
class _Press:
    """A press with its image compared with the background, and what it adds to a fit."""

    name: str
    stated_mm: float
    colours: ColourChange
    ball: BallContact
    sums: PressNormalEquations


def press_sizes(
    images: Sequence[BallImage],
    result: InPlaceResult,
    noise: Float64Array,
    towards: InPlaceModel | None = None,
) -> tuple[PressSize, ...]:
    """Return the used press that contradicts the others most, and the sizes of refused presses.

    Parameters
    ----------
    images : sequence of BallImage
        All presses as given to the calibration.
    result : InPlaceResult
        Their calibration.
    noise : (3,)
        Standard deviation of a pixel of a single image.
    towards : InPlaceModel, optional
        The earlier calibration that was corrected.

    Returns
    -------
    tuple of PressSize
        The used press first. Empty with too few presses.
    """
    model = result.model
    lights = press_lights(images, model.grid, model.background, noise)

    def prepared(image: BallImage, ball: BallContact) -> _Press:
        colours = model.change(image.rgb, 1.0 + lights[image.name][0].gain)
        return _Press(image.name, 2.0 * image.radius_mm, colours, ball, press_sums(colours, ball))

    by_name = {image.name: image for image in images}
    used = [prepared(by_name[press.name], press.ball) for press in result.presses]
    if len(used) <= LEAST_OTHERS:
        return ()
    prior = None if towards is None else towards.coefficients
    ridge = replace(FIRST_RIDGE, towards=prior)
    ratios = np.array([press.held_out.diameter_ratio for press in result.presses])

    def loss_without(press: _Press) -> float:
        sums = [other.sums for other in used if other is not press]
        return squared_loss(sums, leave_one_out_fits(sums, ridge))

    # Those that look worst, and the one that disturbs the others most.
    losses = list(in_parallel(loss_without, used))
    worst = {int(np.argmin(losses)), int(np.argmin(ratios)), int(np.argmax(ratios))}
    sizes = [_size(used[k], [p for p in used if p is not used[k]], model, prior) for k in worst]
    best = max((s for s in sizes if s), key=lambda s: s.excess, default=None)
    refused = []
    for name in result.refused:
        contact = _contact(by_name[name], model) if name in by_name else None
        if contact is not None:
            refused.append(_size(prepared(by_name[name], contact), used, model, prior))
    return tuple(size for size in (best, *refused) if size is not None)


def _contact(image: BallImage, model: InPlaceModel) -> BallContact | None:
    """Return the contact of a refused press, or None if its image shows none."""
    radius = image.radius_mm / model.grid.pitch_mm
    try:
        reduced = model.grid.reduce(image.rgb)
        edge = contact_in(reduced, model.reference, radius=radius, name=image.name).circle
    except InputError:
        return None
    return BallContact(edge.x, edge.y, edge.radius, radius, model.grid.rest).limited()


def _size(
    press: _Press,
    others: Sequence[_Press],
    model: InPlaceModel,
    prior: Float64Array | None,
) -> PressSize | None:
    """Return the size of a press by a fit to the others, or None where it cannot be compared."""
    if not press.sums.nodes:
        return None
    sums = [other.sums for other in others]
    ridge = choose_ridge(sums, prior)
    without = leave_one_out_fits(sums, ridge)
    colours, balls = (
        [other.colours for other in others],
        [other.ball for other in others],
    )
    share = float(np.median(held_out_slope_ratios(colours, balls, without)))

    def held_out(item: tuple[_Press, Float64Array]) -> HeldOutPress:
        return held_out_press(item[0].colours, item[0].ball, item[1] / share)

    own = held_out((press, solve_ridge(sums, ridge)))
    compared = list(in_parallel(held_out, list(zip(others, without, strict=True))))
    # A press that the border cuts is less certain.
    is_cut = math.isnan(own.cap_ratio)
    logs = np.log([p.diameter_ratio for p in compared if math.isnan(p.cap_ratio) == is_cut])
    logs = logs[np.isfinite(logs)]
    if len(logs) < LEAST_OTHERS or not own.diameter_ratio > 0.0:
        return None
    chance = 0.5 * FALSE_ALARMS / (len(others) + 1)
    sd = float(logs.std(ddof=1)) * math.sqrt(1.0 + 1.0 / len(logs))
    limit = float(stdtrit(len(logs) - 1, 1.0 - chance)) * sd
    fitted_mm = press.stated_mm * own.diameter_ratio / math.exp(logs.mean())
    # The nearest of the stated sizes, where one is as good as the fitted one.
    nearest_mm = min(
        (other.stated_mm for other in others), key=lambda mm: abs(math.log(mm / fitted_mm))
    )
    fits_as_well = abs(math.log(nearest_mm / fitted_mm)) <= limit
    proposed_mm = nearest_mm if fits_as_well else float(f"{fitted_mm:.2g}")
    return PressSize(press.name, press.stated_mm, fitted_mm, proposed_mm, limit)
