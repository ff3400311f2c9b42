"""Joint refinement of LEDs, balls and membrane on the ball presses.

Press over background cancels light intensity and reflectance factor, so what is left depends on
geometry and on the membrane's response alone. Both the balls and the drape around them are used:
the drape is concave, as the walls of pressed objects are, and receives light from its surroundings
that a ball's cap does not. The mirror's LED positions and the housing's Z1 are priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS, CalibrationTerms
from gelpolight_core.lights.positions import light_directions
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.ball import BallPose
from gelpolight_core.reflectance.draped_ball import draped_ball
from gelpolight_core.reflectance.membrane import Membrane, bounce_weight
from gelpolight_core.reflectance.press import LEAST_VALUE, SATURATED, BallPress

Array = NDArray[np.float64]
Map = NDArray[np.float32]
BOUNCE_REACH_MM = 1.0
DRAPE_WIDTH_MM = 1.6
EDGE_GAP_MM = 0.12
PIXELS_PER_PART = 800
# What a convex cap receives from its surroundings lies further off and is modelled less well.
CAP_TRUST = 0.3
DARK_COSINE = 0.08
MODEL_ERROR = 0.01
# Pixels of one ball err together (lens, centre, membrane), so that each counts for less than one.
CORRELATION = 4.0
LED_LATERAL_SD_MM = 0.05
LED_HEIGHT_SD_MM = 0.2
PRIOR_STRENGTH = 3.0
_GLOBAL = 15
_STEP = 1e-4


@dataclass(frozen=True, slots=True)
class BallPixels:
    """Pixels of one press on the ball's cap and on the drape around it.

    Attributes
    ----------
    points_mm, drift, view : (N, 2), (N, 2), (N, 3)
        Rays, and unit directions back to the camera.
    ratio, weight, around : (N, 3)
        Press over background, 1 / its standard deviation, and its average in the neighbourhood.
    radius_mm : float
        Of the ball.
    """

    points_mm: Array
    drift: Array
    view: Array
    ratio: Array
    weight: Array
    around: Array
    radius_mm: float


@dataclass(frozen=True, slots=True)
class JointResult:
    """LEDs, membrane and balls that explain the presses together.

    Attributes
    ----------
    led_positions_mm, led_sd_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        With the drape's share of light from the neighbourhood.
    membrane_sd : dict
        Standard deviations of its parameters.
    cap_bounce : float
        The same share on the convex caps of the balls.
    decay_mm : float
        Decay length of the drape.
    balls : tuple of BallPose
        Refined.
    misfit : float
        Robust relative misfit over all pixels.
    held_out : tuple of 2 floats
        Mean robust loss on presses that were held out: with the mirror's LEDs, and with refined
        ones.
    kept : str
        ``refined`` or ``mirror``: whose LEDs were the better on what was held out.
    """

    led_positions_mm: Array
    led_sd_mm: Array
    membrane: Membrane
    membrane_sd: dict[str, float]
    cap_bounce: float
    decay_mm: float
    balls: tuple[BallPose, ...]
    misfit: float
    held_out: tuple[float, float]
    kept: str


def view_directions(drift: Array) -> Array:
    """Return unit directions (..., 3) back along the rays, from their drift (..., 2)."""
    view = np.concatenate([drift, -np.ones_like(drift[..., :1])], axis=-1)
    return np.asarray(view / np.linalg.norm(view, axis=-1, keepdims=True))


def neighbourhood(ratio: Map, valid: NDArray[np.bool_], pitch_mm: float, reach_mm: float) -> Map:
    """Return press over background, averaged over a Gaussian; 1 where it is not known."""
    known = np.clip(np.where(valid[..., None], ratio, 1.0), 0.0, 4.0).astype(np.float32)
    factor = max(int(reach_mm / pitch_mm / 4.0), 1)
    rows, columns = valid.shape
    small = cv2.resize(known, (columns // factor, rows // factor), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), reach_mm / pitch_mm / factor)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))


def gather_ball_pixels(
    press: BallPress,
    picture: Map,
    background: Map,
    table: ResamplingTable,
    usable: NDArray[np.bool_],
    noise: Array,
) -> BallPixels:
    """Choose pixels on a ball's cap and on the drape around it.

    Parameters
    ----------
    press : BallPress
        The ball as found.
    picture, background : (rows, columns, 3) float32
        Resampled, crosstalk removed.
    table : ResamplingTable
        The grid and its rays.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    noise : (3,)
        Standard deviation of press minus background.
    """
    grid = table.grid
    base = np.maximum(background, LEAST_VALUE)
    ratio = np.asarray(picture / base, np.float32)
    around = neighbourhood(ratio, usable, grid.pitch_mm, BOUNCE_REACH_MM)
    column, row = np.round(grid.to_index(np.asarray(press.pose.centre_mm))).astype(int)
    centre = press.seen_centre_mm(table.drift[row, column].astype(np.float64))
    away = np.hypot(grid.x_mm[None, :] - centre[0], grid.y_mm[:, None] - centre[1])
    contact = press.contact_radius_mm
    random = np.random.default_rng(0)
    parts = (
        (CAP_TRUST, 0.0, 0.9 * contact),
        (1.0, contact + EDGE_GAP_MM, contact + DRAPE_WIDTH_MM),
    )
    chosen, trust = [], []
    for part, low, high in parts:
        places = np.flatnonzero((usable & (away >= low) & (away < high)).ravel())
        chosen.append(random.permutation(places)[:PIXELS_PER_PART])
        trust.append(np.full((chosen[-1].size, 1), part))
    rows, columns = np.unravel_index(np.concatenate(chosen), away.shape)
    value = picture[rows, columns].astype(np.float64)
    below = base[rows, columns].astype(np.float64)
    known = (value > LEAST_VALUE) & (value < SATURATED) & (background[rows, columns] > LEAST_VALUE)
    sd = np.hypot(np.hypot(noise / np.sqrt(2.0), MODEL_ERROR * value) / below, MODEL_ERROR)
    drift = table.drift[rows, columns].astype(np.float64)
    return BallPixels(
        np.stack([grid.x_mm[columns], grid.y_mm[rows]], axis=-1),
        drift,
        view_directions(drift),
        value / below,
        np.where(known, np.concatenate(trust) / sd, 0.0),
        around[rows, columns].astype(np.float64),
        press.pose.radius_mm,
    )


@dataclass(frozen=True, slots=True)
class _Problem:
    """Residuals of all presses, with priors.

    Parameters are the LEDs (9), exponent, gloss, roughness, cap's and drape's bounce, decay length,
    and then x, y and depth of each ball; those that are not `free` are held.
    """

    presses: Sequence[BallPixels]
    start: Array
    free: NDArray[np.bool_]

    def residuals(self, x: Array) -> list[Array]:
        return [self._press(x, i) for i in range(len(self.presses))]

    def _press(self, x: Array, index: int) -> Array:
        pixels = self.presses[index]
        leds = x[:9].reshape(3, 3)
        membrane = Membrane(float(x[9]), float(x[10]), float(x[11]))
        at = _GLOBAL + 3 * index
        pose = BallPose((float(x[at]), float(x[at + 1])), pixels.radius_mm, float(x[at + 2]))
        surface, normals, on_ball = draped_ball(
            pixels.points_mm, pixels.drift, pose, decay_mm=float(x[14])
        )
        flat = np.concatenate([pixels.points_mm, np.zeros((len(surface), 1))], axis=1)
        light, distance = light_directions(leds, surface)
        flat_light, flat_distance = light_directions(leds, flat)
        gain = light[..., 2] / flat_light[..., 2] * (flat_distance / distance) ** 2
        up = np.broadcast_to([0.0, 0.0, -1.0], flat.shape)
        direct = membrane.response(light, normals, pixels.view)
        direct /= membrane.response(flat_light, up, pixels.view)
        share = np.where(on_ball, x[12], x[13]) * bounce_weight(normals)
        facing = np.einsum("nkc,nc->nk", light, normals)
        # What lies in shadow, or near it, depends on shadows that are not modelled here.
        lit = np.clip((facing - DARK_COSINE) / DARK_COSINE, 0.0, 1.0)
        model = gain * direct + share[:, None] * pixels.around
        error = (model - pixels.ratio) * pixels.weight * lit / CORRELATION
        return np.asarray(error.ravel())

    def priors(self, x: Array) -> Array:
        moved = (x[:9] - self.start[:9]).reshape(3, 3)
        return np.concatenate(
            [
                PRIOR_STRENGTH * moved[:, :2].ravel() / LED_LATERAL_SD_MM,
                PRIOR_STRENGTH * moved[:, 2] / LED_HEIGHT_SD_MM,
                # Exponent and gloss trade off; a diffuse share that departs from Lambert's law has
                # to be asked for by the data (the loss lets it go far), as has an unseen lobe.
                [PRIOR_STRENGTH * (x[9] - 1.0) / 0.01, (x[12] - x[13]) / 0.2, (x[11] - 0.5) / 0.3],
            ]
        )

    def all(self, x: Array) -> Array:
        return np.concatenate([*self.residuals(x), self.priors(x)])

    def jacobian(self, x: Array) -> Array:
        """Finite differences; a ball's own parameters are moved for all balls at once."""
        base = self.residuals(x)
        ends = np.cumsum([r.size for r in base])
        starts = ends - [r.size for r in base]
        prior = self.priors(x)
        result = np.zeros((ends[-1] + prior.size, x.size))
        for j in np.flatnonzero(self.free[:_GLOBAL]):
            moved = x.copy()
            moved[j] += _STEP
            for i, r in enumerate(self.residuals(moved)):
                result[starts[i] : ends[i], j] = (r - base[i]) / _STEP
            result[ends[-1] :, j] = (self.priors(moved) - prior) / _STEP
        for axis in range(3):
            moved = x.copy()
            moved[_GLOBAL + axis :: 3] += _STEP
            for i, r in enumerate(self.residuals(moved)):
                result[starts[i] : ends[i], _GLOBAL + 3 * i + axis] = (r - base[i]) / _STEP
        return result


def refine_jointly(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    led_positions_mm: Array,
    *,
    terms: CalibrationTerms = ALL_CALIBRATION_TERMS,
) -> JointResult:
    """Refine LEDs, membrane and balls together; keep the mirror's LEDs where they do better.

    Parameters
    ----------
    presses, pixels : sequences of equal length
        The balls as found, and their pixels.
    led_positions_mm : (3, 3)
        From the mirror spots.
    terms : CalibrationTerms, optional
        What is fitted; by default everything.
    """
    held_out = _held_out(presses, pixels, led_positions_mm, terms)
    refine = held_out[1] <= held_out[0]
    solved = _solve(presses, pixels, led_positions_mm, terms, refine=refine)
    x, sd = solved.x, solved.sd
    names = ("exponent", "gloss", "roughness", "cap_bounce", "bounce", "decay_mm")
    return JointResult(
        x[:9].reshape(3, 3),
        sd[:9].reshape(3, 3),
        Membrane(float(x[9]), float(x[10]), float(x[11]), float(x[13]), BOUNCE_REACH_MM),
        dict(zip(names, sd[9:_GLOBAL].tolist(), strict=True)),
        float(x[12]),
        float(x[14]),
        tuple(
            BallPose((float(cx), float(cy)), p.radius_mm, float(depth))
            for (cx, cy, depth), p in zip(x[_GLOBAL:].reshape(-1, 3), pixels, strict=True)
        ),
        solved.misfit,
        held_out,
        "refined" if refine else "mirror",
    )


def _thinned(pixels: BallPixels) -> BallPixels:
    """Return every second pixel."""
    return BallPixels(
        pixels.points_mm[::2],
        pixels.drift[::2],
        pixels.view[::2],
        pixels.ratio[::2],
        pixels.weight[::2],
        pixels.around[::2],
        pixels.radius_mm,
    )


@dataclass(frozen=True, slots=True)
class _Solution:
    """Parameters, their standard deviations, robust misfit of the ratio, and mean robust loss."""

    x: Array
    sd: Array
    misfit: float
    loss: float


def _start(
    presses: Sequence[BallPress], leds: Array, terms: CalibrationTerms
) -> tuple[Array, NDArray[np.bool_]]:
    """Return where the fit starts, and which parameters the terms leave free."""
    balls = [[*p.pose.centre_mm, p.pose.depth_mm] for p in presses]
    gloss, bounce = 0.05 * terms.gloss, 0.1 * terms.bounce
    start = np.concatenate([leds.ravel(), [1.0, gloss, 0.5, bounce, bounce, 0.7], np.ravel(balls)])
    free = np.ones(start.size, bool)
    free[:9] = terms.led_refinement
    free[9:14] = [terms.exponent, terms.gloss, terms.gloss, terms.bounce, terms.bounce]
    return start, free


def _solve(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds: Array,
    terms: CalibrationTerms,
    *,
    refine: bool,
    common: Array | None = None,
) -> _Solution:
    """Solve for all parameters; with `common`, the first 15 are held and only the balls move."""
    start, free = _start(presses, leds, terms)
    free[: _GLOBAL if common is not None else (0 if refine else 9)] = False
    low, high = np.full(start.size, -np.inf), np.full(start.size, np.inf)
    low[9:_GLOBAL] = [0.5, 0.0, 0.15, 0.0, 0.0, 0.15]
    high[9:_GLOBAL] = [1.8, 0.9, 1.0, 1.5, 1.5, 3.0]
    depth_at = slice(_GLOBAL + 2, None, 3)
    low[depth_at] = 0.02
    high[depth_at] = [0.95 * p.radius_mm for p in pixels]
    start[depth_at] = np.clip(start[depth_at], 0.03, 0.9 * high[depth_at])
    if common is not None:
        start[:_GLOBAL] = common
    problem = _Problem(pixels, start, free)
    scale = np.concatenate([np.full(14, 0.1), [0.05], np.tile([0.02, 0.02, 0.05], len(pixels))])

    def whole(moved: Array) -> Array:
        x = start.copy()
        x[free] = moved
        return x

    fit = least_squares(
        lambda moved: problem.all(whole(moved)),
        start[free],
        jac=lambda moved: problem.jacobian(whole(moved))[:, free],
        bounds=(low[free], high[free]),
        loss="soft_l1",
        x_scale=scale[free],
        ftol=1e-5,
        xtol=1e-5,
        max_nfev=40,
    )
    x = whole(fit.x)
    scaled = np.concatenate(problem.residuals(x))
    loss = float(np.mean(np.sqrt(1.0 + scaled**2) - 1.0))
    left = CORRELATION * np.concatenate(problem.residuals(x))
    weight = np.concatenate([p.weight.ravel() for p in pixels])
    seen = (weight > 0.0) & (left != 0.0)
    misfit = 1.4826 * float(np.median(np.abs(left[seen] / weight[seen])))
    curvature = problem.jacobian(x)[:, free]
    variance = np.diag(np.linalg.pinv(curvature.T @ curvature))
    sd = np.zeros(x.size)
    sd[free] = np.sqrt(np.maximum(variance, 0.0))
    return _Solution(x, sd, misfit, loss)


def _held_out(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds: Array,
    terms: CalibrationTerms,
) -> tuple[float, float]:
    """Return the mean robust loss on every second press, from a fit to the others.

    First with the mirror's LEDs, then with refined ones.
    """
    even, odd = slice(0, None, 2), slice(1, None, 2)
    if len(presses) < 4 or not terms.led_refinement:
        return 0.0, 1.0  # too few to hold any out, or nothing to choose: the mirror's LEDs stay
    # Half of the pixels tell which of two fits is the better as well as all do.
    pixels = [_thinned(p) for p in pixels]
    result: list[float] = []
    for refine in (False, True):
        fitted = _solve(presses[even], pixels[even], leds, terms, refine=refine)
        common = fitted.x[:_GLOBAL]
        judged = _solve(presses[odd], pixels[odd], leds, terms, refine=refine, common=common)
        result.append(judged.loss)
    return result[0], result[1]
