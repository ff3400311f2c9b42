"""Calibration of a closed sensor: from a background and ball presses to slopes.

The edges of the contacts give a first position of each ball. Then polynomial and positions are
refined alternately. The position of a press is the mean of that from the slopes of the other
presses and that of its edge; otherwise slopes and positions could drift together. Presses that
disagree with the others are left out and listed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np
from scipy import ndimage

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.health.global_change import LEAST_START
from gelpolight_core.health.press_scatter import changes_of
from gelpolight_core.sensor.closed_sensor.colour_change import (
    SMOOTHING_NODES,
    SMOOTHINGS,
    ColourChange,
    ReferenceImage,
    colour_change,
    make_reference_image,
)
from gelpolight_core.sensor.closed_sensor.slope_model import (
    COLOUR_CELLS,
    InPlaceModel,
    colour_cells,
    evaluate_slopes,
)
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid
from gelpolight_core.stages.balls.ball_detection import detect_ball, find_indentation
from gelpolight_core.stages.balls.indentation import Indentation

from .ball_contact import (
    BallContact,
    contact_radius_by_slopes,
    next_position,
    offsets_from_centre,
    refine_centre_by_slopes,
)
from .contact_aspect import ContactAspect, stretch_of
from .held_out import (
    HeldOutPress,
    error_curve,
    explained_share,
    held_out_press,
    held_out_slope_ratios,
)
from .press_light_change import (
    BallImage,
    PressLights,
    press_lights,
    refuse_dead_channel,
    share_as_background,
)
from .ridge_fit import (
    INSIDE,
    PressNormalEquations,
    RidgePenalty,
    choose_ridge,
    learning_curve,
    leave_one_out_fits,
    mean_squared_error,
    press_sums,
    solve_ridge,
    squared_loss,
)

LEAST_PRESSES = 3
"""Presses that a calibration needs by itself; one is enough to correct an earlier one."""
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
LEARNT = 0.5
"""Share of the squared slopes of presses left out that must be found if the membrane around the
balls does not look like the background. Chosen: with less, most of a slope would be an error."""
BACKGROUND_ADVICE = "Use a background of the same gel, crop, size and exposure as the ball images"


@dataclass(frozen=True, slots=True)
class InPlacePress:
    """A press as used by the calibration.

    Attributes
    ----------
    name : str
        Its file.
    ball : BallContact
        Position and contact, nodes of the working grid.
    held_out : HeldOutPress
        Its errors in a calibration without it.
    width : float
        Radius of the contact's edge over the ball's, as seen; `ball` is limited.
    """

    name: str
    ball: BallContact
    held_out: HeldOutPress
    width: float = math.nan


@dataclass(frozen=True, slots=True)
class InPlaceResult:
    """An in-place calibration with its presses.

    Attributes
    ----------
    model : InPlaceModel
        Background and slopes.
    presses : tuple of InPlacePress
        As used, in the order given.
    refused : mapping of str to InputError
        Presses that were left out, with the reason.
    learning : tuple of (int, float)
        Number of balls, and root mean square slope error of other presses with this number.
    next_position_mm : tuple of 2 floats
        Best position of the next ball: farthest from all presses.
    stretch : ContactAspect or None
        Height over width of the contacts; None where too few edges are seen.
    sizes : tuple of (float, float, float)
        Radius of each size of ball, mm, the ratio of its slopes by the presses of all other sizes
        to the true ones, and its standard deviation. Empty if all balls are alike.
    as_background : float
        Share of the membrane around the balls that looks like the background, median.
    has_markers : bool
        Whether the membrane has markers.
    """

    model: InPlaceModel
    presses: tuple[InPlacePress, ...]
    refused: Mapping[str, InputError] = field(default_factory=dict)
    learning: tuple[tuple[int, float], ...] = ()
    next_position_mm: tuple[float, float] = (0.0, 0.0)
    stretch: ContactAspect | None = None
    sizes: tuple[tuple[float, float, float], ...] = ()
    as_background: float = 1.0
    has_markers: bool = False

    @property
    def is_of_background(self) -> bool:
        """Whether the membrane around the balls looks like the background."""
        return self.as_background >= LEAST_START


@dataclass(frozen=True, slots=True)
class _PressRefinement:
    """A press during the refinement, with the first and the present contact."""

    name: str
    image: Float32Array
    gain: Float64Array
    colours: ColourChange
    start: BallContact
    ball: BallContact
    stretches: tuple[float, ...]
    width: float

    def relative_to(self, bare: ReferenceImage) -> _PressRefinement:
        """Return the press with its change of colour from this reference."""
        return replace(self, colours=colour_change(self.image, bare, self.gain))


def calibrate_in_place(
    background: Float32Array,
    presses: Sequence[BallImage],
    grid: WorkingGrid,
    noise: Float64Array,
    *,
    scale_sd: float,
    towards: InPlaceModel | None,
    progress: Callable[[float], None],
) -> InPlaceResult:
    """Calibrate a closed sensor.

    Parameters
    ----------
    background : (height, width, 3) float32
        Linear light of the untouched membrane.
    presses : sequence of BallImage
        Images of pressed balls.
    grid : WorkingGrid
        Nodes and scale.
    noise : (3,)
        Standard deviation of a pixel of a single image.
    scale_sd : float
        Relative standard deviation of the scale.
    towards : InPlaceModel or None
        An earlier calibration that few presses correct.
    progress : callable
        Called with the share done.

    Raises
    ------
    InputError
        If fewer than 3 images (without `towards`) show a ball that agrees with the others, or a
        background of another gel, crop or sensor explains too little of the slopes of presses that
        are left out.
    """
    reduced = grid.reduce(background)
    bare = make_reference_image(
        reduced, SMOOTHING_NODES if towards is None else towards.smoothing_nodes
    )
    prior = None if towards is None else towards.coefficients
    images = list(in_parallel(lambda press: grid.reduce(press.rgb), presses))
    least = least_presses(towards)
    if len(images) >= LEAST_PRESSES:  # fewer do not show all directions of slope
        refuse_dead_channel(images, reduced)
    lights = press_lights(presses, grid, reduced, noise)
    contacts, refused = _begin(presses, images, lights, bare, grid, progress)
    as_background = share_as_background(lights)
    if len(contacts) < least and as_background < LEAST_START:
        raise _not_the_background(as_background)
    _require_presses(contacts, refused, least)
    stretch = stretch_of([press.stretches for press in contacts])
    sums = _sums(contacts)
    ridge = choose_ridge(sums, prior)
    for round_number in range(ROUNDS):
        if round_number > 0:
            without = leave_one_out_fits(sums, ridge)
            contacts, sums = _explained(contacts, refused, sums, without, least)
        progress(0.35 + 0.15 * round_number)
        contacts = _placed(contacts, leave_one_out_fits(sums, ridge), bare.smoothing_nodes)
        sums = _sums(contacts)
    if towards is None:
        bare, contacts = _as_smooth_as_needed(contacts, reduced, ridge)
        sums = _sums(contacts)
    ridge = choose_ridge(sums, prior)
    without = leave_one_out_fits(sums, ridge)
    contacts, sums = _explained(contacts, refused, sums, without, least)
    progress(0.85)
    without = leave_one_out_fits(sums, ridge)
    colours, balls = [press.colours for press in contacts], [press.ball for press in contacts]
    share = float(np.median(held_out_slope_ratios(colours, balls, without)))
    items = zip(colours, balls, [c / share for c in without], strict=True)
    held_out = tuple(in_parallel(lambda item: held_out_press(*item), items))
    if as_background < LEAST_START and explained_share(held_out) < LEARNT:
        raise _not_the_background(as_background)
    model = InPlaceModel(
        grid,
        reduced,
        solve_ridge(sums, ridge) / share,
        _seen_colours(contacts),
        max(map(_steepest, balls)),
        error_curve(held_out, pitch_mm=grid.pitch_mm),
        scale_sd=scale_sd,
        press_light=np.array([changes_of(*lights[press.name]) for press in contacts]),
        smoothing_nodes=bare.smoothing_nodes,
    )
    progress(1.0)
    pairs = zip(contacts, held_out, strict=True)
    return InPlaceResult(
        model,
        tuple(InPlacePress(press.name, press.ball, held, press.width) for press, held in pairs),
        refused,
        learning_curve(sums, ridge),
        next_position(balls, grid, bare.known),
        stretch,
        _sizes(contacts, sums, lambda rest: solve_ridge(rest, ridge) / share, grid),
        as_background,
        bool(bare.markers),
    )


def least_presses(towards: InPlaceModel | None) -> int:
    """Return how many presses are needed, with or without an earlier calibration."""
    return LEAST_PRESSES if towards is None else 1


def contact_in(
    image: Float32Array, bare: ReferenceImage, *, radius: float, name: str
) -> Indentation:
    """Return the contact of a ball, in nodes, also where the border cuts it.

    Parameters
    ----------
    image : (rows, columns, 3) float32
        Linear light on the working grid.
    bare : ReferenceImage
        The untouched membrane.
    radius : float
        Radius of the ball.
    name : str
        Name of the image in messages.

    Raises
    ------
    InputError
        If the image shows no ball.
    """
    return find_indentation(
        image, bare.background, markers=bare.markers, ball_radius_px=radius, cut=True, name=name
    )


def _begin(
    presses: Sequence[BallImage],
    images: Sequence[Float32Array],
    lights: PressLights,
    bare: ReferenceImage,
    grid: WorkingGrid,
    progress: Callable[[float], None],
) -> tuple[list[_PressRefinement], dict[str, InputError]]:
    """Return the contacts in the reduced images, with the errors of refused images."""

    def seen_radius(image: Float32Array) -> float:
        indentation = detect_ball(image, bare.background, markers=bare.markers).indentation
        return 0.0 if indentation is None else indentation.contact_radius_px

    def find(item: tuple[BallImage, Float32Array]) -> _PressRefinement | InputError:
        press, image = item
        radius = press.radius_mm / grid.pitch_mm
        stretches: tuple[float, ...] = ()
        try:
            if press.placed is not None:
                edge = grid.on_nodes(press.placed)
            else:
                contact = contact_in(image, bare, radius=radius, name=press.name)
                edge, stretches = contact.circle, contact.stretches
        except InputError as fault:
            width = seen_radius(image)
            if width <= radius:
                return fault
            wide_mm, ball_mm = 2.0 * (width * grid.pitch_mm), 2.0 * press.radius_mm
            text = (
                f"with the stated scale the contact is {wide_mm:.3g} mm wide, its ball only "
                f"{ball_mm:.3g} mm"
            )
            return InputError(text, press.name, Remedy.CHECK_SIZES)
        ball = BallContact(edge.x, edge.y, edge.radius, radius, grid.rest).limited()
        # Only a ball's radius limits the edge that is found.
        width = max(edge.radius, seen_radius(image)) if edge.radius > radius else edge.radius
        gain = 1.0 + lights[press.name][0].gain
        colours = colour_change(image, bare, gain)
        return _PressRefinement(
            press.name, image, gain, colours, ball, ball, stretches, width / radius
        )

    contacts: list[_PressRefinement] = []
    refused: dict[str, InputError] = {}
    with closing(in_parallel(find, list(zip(presses, images, strict=True)))) as results:
        for index, (press, contact) in enumerate(zip(presses, results, strict=True)):
            progress(0.3 * (index + 1) / len(presses))
            if isinstance(contact, InputError):
                refused[press.name] = contact
            else:
                contacts.append(contact)
    return contacts, refused


def _not_the_background(share: float) -> InputError:
    text = f"the background looks like {100.0 * share:.0f} % of the membrane around the balls"
    return InputError(text, "background", BACKGROUND_ADVICE)


def _require_presses(
    presses: Sequence[_PressRefinement], refused: Mapping[str, InputError], least: int
) -> None:
    if len(presses) >= least:
        return
    reasons = sorted({fault.found for fault in refused.values()})
    wide = [fault.advice for fault in refused.values()].count(Remedy.CHECK_SIZES)
    total = len(presses) + len(refused)
    text = f"{len(presses)} of {total} images show a pressed ball, {least} are needed"
    text += f" ({'; '.join(reasons[:2])})" if reasons else ""
    advice = Remedy.CHECK_SIZES if 2 * wide > len(refused) else Remedy.PRESS_BALLS
    raise InputError(text, "balls", advice)


def _sums(presses: Sequence[_PressRefinement]) -> list[PressNormalEquations]:
    return list(in_parallel(lambda press: press_sums(press.colours, press.ball), presses))


def _placed(
    presses: Sequence[_PressRefinement],
    coefficients: Sequence[Float64Array],
    smoothing_nodes: float,
) -> list[_PressRefinement]:
    """Move each ball halfway to the position that follows from the slopes of the others."""
    slope_weight = TRUST_SLOPES * min(1.0, len(presses) / MANY_PRESSES)

    def moved(item: tuple[_PressRefinement, Float64Array]) -> _PressRefinement:
        press, coefficient = item
        start = press.start
        slope_x, slope_y = evaluate_slopes(coefficient, press.colours.change)
        by_slopes = refine_centre_by_slopes(slope_x, slope_y, press.ball)
        distance = float(np.hypot(by_slopes.x - start.x, by_slopes.y - start.y))
        edge_weight = (1.0 - slope_weight) / (1.0 + (distance / (DISAGREES * start.contact)) ** 2)
        # A centre outside the contact that is seen is not that of its ball.
        edge_weight = edge_weight if distance < start.contact else 1.0
        x = edge_weight * start.x + (1.0 - edge_weight) * by_slopes.x
        y = edge_weight * start.y + (1.0 - edge_weight) * by_slopes.y
        placed = replace(press.ball, x=x, y=y)
        contact = contact_radius_by_slopes(slope_x, slope_y, placed, smoothing=smoothing_nodes)
        ball = replace(placed, contact=0.5 * (start.contact + contact)).limited()
        return replace(press, ball=ball)

    return list(in_parallel(moved, list(zip(presses, coefficients, strict=True))))


def _as_smooth_as_needed(
    presses: Sequence[_PressRefinement], background: Float32Array, ridge: RidgePenalty
) -> tuple[ReferenceImage, list[_PressRefinement]]:
    """Return reference and presses with the smoothing by which left-out slopes are most correct."""

    def loss(tried: Sequence[_PressRefinement]) -> float:
        sums = _sums(tried)
        return squared_loss(sums, leave_one_out_fits(sums, ridge))

    references = [make_reference_image(background, nodes) for nodes in SMOOTHINGS]
    smoothed = ([press.relative_to(bare) for press in presses] for bare in references)
    return min(zip(references, smoothed, strict=True), key=lambda tried: loss(tried[1]))


def _sizes(
    presses: Sequence[_PressRefinement],
    sums: Sequence[PressNormalEquations],
    fit: Callable[[Iterable[PressNormalEquations]], Float64Array],
    grid: WorkingGrid,
) -> tuple[tuple[float, float, float], ...]:
    """Return radius (mm), slope ratio by presses of other sizes and sd, for each size."""
    radii = [press.ball.radius for press in presses]
    sizes = []
    for radius in sorted(set(radii)):
        same_size = [press for press in presses if press.ball.radius == radius]
        other_sums = [part for part, other in zip(sums, radii, strict=True) if other != radius]
        if len(same_size) > 1 and len(other_sums) >= LEAST_PRESSES:
            colours = [press.colours for press in same_size]
            balls = [press.ball for press in same_size]
            ratios = held_out_slope_ratios(colours, balls, [fit(other_sums)] * len(same_size))
            # Of the median of normal values.
            sd = float(ratios.std(ddof=1)) * math.sqrt(0.5 * math.pi / len(same_size))
            sizes.append((radius * grid.pitch_mm, float(np.median(ratios)), sd))
    return tuple(sizes)


def _explained(
    presses: Sequence[_PressRefinement],
    refused: dict[str, InputError],
    sums: Sequence[PressNormalEquations],
    coefficients: Sequence[Float64Array],
    least: int,
) -> tuple[list[_PressRefinement], list[PressNormalEquations]]:
    """Return the presses whose slopes agree with the others, with their sums."""
    errors = np.sqrt(
        [mean_squared_error(press, c) for press, c in zip(sums, coefficients, strict=True)]
    )
    limit = max(OUTLIER * float(np.median(errors)), LEAST_OUTLIER)
    agreeing = [bool(error <= limit) for error in errors]
    for press, agrees, error in zip(presses, agreeing, errors, strict=True):
        if not agrees:
            text = (
                "its shading does not fit a ball of the stated diameter, compared with the other "
                f"presses (slope error {error:.2f}, other presses {float(np.median(errors)):.2f})"
            )
            refused[press.name] = InputError(text, press.name, Remedy.CHECK_RADIUS)
    rest = list(compress(presses, agreeing))
    _require_presses(rest, refused, least)
    return rest, list(compress(sums, agreeing))


def _seen_colours(presses: Sequence[_PressRefinement]) -> Float32Array:
    """Return the mask of colour changes that occur on presses and the flat membrane."""
    cells = np.zeros((COLOUR_CELLS,) * 3, np.float32)
    for press in presses:
        colours, ball = press.colours, press.ball
        rho = offsets_from_centre((colours.usable.shape[0], colours.usable.shape[1]), ball)[2]
        settled = (rho < ball.contact) | (rho > 1.4 * ball.contact)
        cell = colour_cells(colours.change[colours.usable & settled])
        cells[cell[:, 0], cell[:, 1], cell[:, 2]] = 1.0
    return np.asarray(ndimage.binary_dilation(cells), np.float32)


def _steepest(ball: BallContact) -> float:
    return float(ball.inward(np.array([INSIDE * ball.contact]))[0])
