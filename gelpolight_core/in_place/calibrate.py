"""Calibration of a closed sensor: from a background and ball presses to slopes.

The edges of the contacts give a first position of each ball. Then polynomial and positions are
refined alternately. The position of a press is the mean of that from the slopes of the other
presses and that of its edge; otherwise slopes and positions could drift together. Presses that
disagree with the others are left out and listed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.in_place.ball import Ball, contact_by_slopes, distances, placed_by_slopes
from gelpolight_core.in_place.dead_channel import refuse_dead_channel
from gelpolight_core.in_place.fit import (
    FIRST_RIDGE,
    INSIDE,
    PressSums,
    Ridge,
    choose_ridge,
    left_out,
    mean_squared_error,
    press_sums,
    solve,
)
from gelpolight_core.in_place.held_out import (
    HeldOutPress,
    amplitude_of,
    error_curve,
    held_out_presses,
)
from gelpolight_core.in_place.next_ball import learning_curve, next_position
from gelpolight_core.in_place.press import find_contact
from gelpolight_core.in_place.roundness import Stretch, stretch_of
from gelpolight_core.in_place.same_view import refuse_other_view
from gelpolight_core.parallel import in_parallel
from gelpolight_core.reconstruction.in_place.change import (
    SMOOTHING_NODES,
    ColourChange,
    Reference,
    colour_change,
    reference,
)
from gelpolight_core.reconstruction.in_place.grid import WorkingGrid
from gelpolight_core.reconstruction.in_place.model import (
    COLOUR_CELLS,
    InPlaceModel,
    colour_cells,
    evaluate,
)
from gelpolight_core.reflectance.contour import Circle
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
Map = NDArray[np.float32]

LEAST_PRESSES = 3
ROUNDS = 3
TRUST_SLOPES = 0.4
"""Weight of the slopes against the edge in the position of a press, from `MANY_PRESSES` on."""
MANY_PRESSES = 20
DISAGREES = 0.3
"""Distance of edge and slopes, in contact radii, above which the slopes alone are used."""
OUTLIER = 3.0
"""A press is left out if its error is this multiple of the median ..."""
LEAST_OUTLIER = 0.12
"""... and above this root mean square slope."""


@dataclass(frozen=True, slots=True)
class PressImage:
    """An image of a pressed ball.

    Attributes
    ----------
    name : str
        Its file.
    rgb : (height, width, 3) float32
        Linear light.
    radius_mm : float
        Of the ball.
    placed : Circle or None
        Contact drawn by hand, camera pixels.
    """

    name: str
    rgb: Map
    radius_mm: float
    placed: Circle | None = None


@dataclass(frozen=True, slots=True)
class FoundPress:
    """A press as used by the calibration.

    Attributes
    ----------
    name : str
        Its file.
    ball : Ball
        Position and contact, nodes of the working grid.
    held_out : HeldOutPress
        Its errors in a calibration without it.
    """

    name: str
    ball: Ball
    held_out: HeldOutPress


@dataclass(frozen=True, slots=True)
class InPlaceResult:
    """A calibration in place with its presses.

    Attributes
    ----------
    model : InPlaceModel
        Background and slopes.
    presses : tuple of FoundPress
        As used, in the order given.
    refused : mapping of str to InputError
        Presses that were left out, with the reason.
    ridge : Ridge
        Chosen by the errors of presses that were left out.
    learning : tuple of (int, float)
        Number of balls, and root mean square slope error of other presses with this number.
    next_position_mm : tuple of 2 floats
        Best position of the next ball: farthest from all presses.
    stretch : Stretch or None
        Height over width of the contacts; None where too few edges are seen.
    """

    model: InPlaceModel
    presses: tuple[FoundPress, ...]
    refused: Mapping[str, InputError] = field(default_factory=dict)
    ridge: Ridge = FIRST_RIDGE
    learning: tuple[tuple[int, float], ...] = ()
    next_position_mm: tuple[float, float] = (0.0, 0.0)
    stretch: Stretch | None = None


@dataclass(slots=True)
class _Work:
    """The presses during the refinement of positions and polynomial."""

    names: list[str]
    seen: list[ColourChange]
    start: list[Ball]
    balls: list[Ball]
    refused: dict[str, InputError]
    stretches: list[tuple[float, ...]]

    def keep(self, kept: Sequence[bool]) -> None:
        """Keep only these presses."""
        self.names = list(compress(self.names, kept))
        self.seen = list(compress(self.seen, kept))
        self.start = list(compress(self.start, kept))
        self.balls = list(compress(self.balls, kept))


def calibrate_in_place(
    background: Map,
    presses: Sequence[PressImage],
    grid: WorkingGrid,
    *,
    scale_sd: float = 0.0,
    towards: Array | None = None,
    progress: Callable[[float], None] | None = None,
) -> InPlaceResult:
    """Calibrate a closed sensor.

    Parameters
    ----------
    background : (height, width, 3) float32
        Linear light of the untouched membrane.
    presses : sequence of PressImage
        Images of pressed balls.
    grid : WorkingGrid
        Nodes and scale.
    scale_sd : float, optional
        Relative standard deviation of the scale.
    towards : (terms, 2), optional
        Coefficients of an earlier calibration that few presses shall correct.
    progress : callable, optional
        Called with the share done.

    Raises
    ------
    InputError
        If fewer than 3 images show a ball that agrees with the others, or the background is of
        another gel, crop or exposure.
    """
    say = progress or (lambda _share: None)
    reduced = grid.reduce(background)
    base = reference(reduced)
    images = list(in_parallel(lambda press: grid.reduce(press.rgb), presses))
    refuse_other_view(images, reduced)
    refuse_dead_channel(images, reduced)
    work = _begin(presses, images, base, grid, say)
    sums, ridge = _sums(work), FIRST_RIDGE
    for turn in range(ROUNDS):
        if turn == 0:
            ridge = choose_ridge(sums, towards=towards)
        else:
            sums = _explained(work, sums, left_out(sums, ridge, towards=towards))
        say(0.35 + 0.15 * turn)
        _place(work, left_out(sums, ridge, towards=towards))
        sums = _sums(work)
    ridge = choose_ridge(sums, towards=towards)
    sums = _explained(work, sums, left_out(sums, ridge, towards=towards))
    say(0.85)
    without = left_out(sums, ridge, towards=towards)
    share = amplitude_of(work.seen, work.balls, without)
    held_out = held_out_presses(work.seen, work.balls, [c / share for c in without])
    model = InPlaceModel(
        grid,
        reduced,
        solve(sums, ridge, towards=towards) / share,
        _seen_colours(work),
        max(_steepest(ball) for ball in work.balls),
        error_curve(held_out, pitch_mm=grid.pitch_mm),
        scale_sd=scale_sd,
    )
    say(1.0)
    return InPlaceResult(
        model,
        tuple(FoundPress(*item) for item in zip(work.names, work.balls, held_out, strict=True)),
        work.refused,
        ridge,
        learning_curve(sums, ridge),
        next_position(work.balls, grid, base.known),
        stretch_of(work.stretches),
    )


def _begin(
    presses: Sequence[PressImage],
    images: Sequence[Map],
    base: Reference,
    grid: WorkingGrid,
    say: Callable[[float], None],
) -> _Work:
    """Find the contact in each reduced image."""

    def find(
        item: tuple[PressImage, Map],
    ) -> tuple[ColourChange, Ball, tuple[float, ...]] | InputError:
        press, image = item
        radius = press.radius_mm / grid.pitch_mm
        stretches: tuple[float, ...] = ()
        try:
            if press.placed is not None:
                edge = grid.on_nodes(press.placed)
            else:
                edge, stretches = find_contact(image, base, ball_radius=radius, name=press.name)
        except InputError as fault:
            return fault
        seen = colour_change(image, base)
        return seen, Ball(edge.x, edge.y, edge.radius, radius).limited(), stretches

    work = _Work([], [], [], [], {}, [])
    with closing(in_parallel(find, list(zip(presses, images, strict=True)))) as contacts:
        for index, (press, found) in enumerate(zip(presses, contacts, strict=True)):
            say(0.3 * (index + 1) / len(presses))
            if isinstance(found, InputError):
                work.refused[press.name] = found
                continue
            work.names.append(press.name)
            work.seen.append(found[0])
            work.start.append(found[1])
            work.balls.append(found[1])
            work.stretches.append(found[2])
    _require_presses(work)
    return work


def _require_presses(work: _Work) -> None:
    if len(work.names) >= LEAST_PRESSES:
        return
    total = len(work.names) + len(work.refused)
    reasons = sorted({fault.found for fault in work.refused.values()})
    found = tr("{n} of {total} images show a pressed ball, {least} are needed").format(
        n=len(work.names), total=total, least=LEAST_PRESSES
    )
    raise InputError(
        f"{found} ({'; '.join(reasons[:2])})" if reasons else found,
        where="balls",
        advice=Remedy.PRESS_BALLS,
    )


def _sums(work: _Work) -> list[PressSums]:
    return list(
        in_parallel(lambda item: press_sums(*item), list(zip(work.seen, work.balls, strict=True)))
    )


def _place(work: _Work, coefficients: Sequence[Array]) -> None:
    """Move each ball halfway to the position that follows from the slopes of the others."""
    trust = TRUST_SLOPES * min(1.0, len(work.balls) / MANY_PRESSES)

    def moved(item: tuple[ColourChange, Ball, Ball, Array]) -> Ball:
        seen, ball, start, coefficient = item
        slope_x, slope_y = evaluate(coefficient, seen.change)
        by_slopes = placed_by_slopes(slope_x, slope_y, ball)
        away = float(np.hypot(by_slopes.x - start.x, by_slopes.y - start.y))
        edge = (1.0 - trust) / (1.0 + (away / (DISAGREES * start.contact)) ** 2)
        x, y = (
            edge * a + (1.0 - edge) * b for a, b in ((start.x, by_slopes.x), (start.y, by_slopes.y))
        )
        placed = replace(ball, x=x, y=y)
        contact = contact_by_slopes(slope_x, slope_y, placed, smoothing=SMOOTHING_NODES)
        return replace(placed, contact=0.5 * (start.contact + contact)).limited()

    items = list(zip(work.seen, work.balls, work.start, coefficients, strict=True))
    work.balls = list(in_parallel(moved, items))


def _explained(
    work: _Work, sums: Sequence[PressSums], coefficients: Sequence[Array]
) -> list[PressSums]:
    """Leave out presses whose slopes disagree with the others; return the sums of the rest."""
    errors = np.sqrt(
        [mean_squared_error(press, c) for press, c in zip(sums, coefficients, strict=True)]
    )
    limit = max(OUTLIER * float(np.median(errors)), LEAST_OUTLIER)
    kept = [bool(error <= limit) for error in errors]
    for name, stays, error in zip(work.names, kept, errors, strict=True):
        if not stays:
            work.refused[name] = InputError(
                tr(
                    "its shading does not fit a ball of the stated radius, compared with the "
                    "other presses (slope error {e:.2f}, other presses {m:.2f})"
                ).format(e=error, m=float(np.median(errors))),
                where=name,
                advice=Remedy.CHECK_RADIUS,
            )
    work.keep(kept)
    _require_presses(work)
    return list(compress(sums, kept))


def _seen_colours(work: _Work) -> Map:
    """Return which changes of colour occur on the presses and the flat membrane."""
    cells = np.zeros((COLOUR_CELLS,) * 3, np.float32)
    for seen, ball in zip(work.seen, work.balls, strict=True):
        rho = distances((seen.usable.shape[0], seen.usable.shape[1]), ball)[2]
        shown = seen.change[seen.usable & ((rho < ball.contact) | (rho > 1.4 * ball.contact))]
        cell = colour_cells(shown)
        cells[cell[:, 0], cell[:, 1], cell[:, 2]] = 1.0
    return np.asarray(ndimage.binary_dilation(cells), np.float32)


def _steepest(ball: Ball) -> float:
    reach = INSIDE * ball.contact
    return float(reach / np.sqrt(ball.radius**2 - reach**2))
