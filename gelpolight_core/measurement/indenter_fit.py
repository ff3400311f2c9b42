"""Fitting an indenter with its drape to a depth map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.least_squares import fit_least_squares, forward_differences
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.membrane_shape import MembraneShape

from .indenter_models import MODELS, SMALLEST_SIZE_MM, IndenterModel
from .segmentation import FitWindow

EDGE_POINTS, OTHER_POINTS = 5000, 3000
"""Points of the fit near the wall and elsewhere. More points only take more time, because the
errors of a depth map are correlated over many pixels."""
BASELINE = ("offset_mm", "tilt_x", "tilt_y")
"""Ground level around the object: after integration it is tilted and off by tens of micrometres."""
HUBER = 2.5
"""Residuals beyond this many sigma lose weight."""
MODEL_ERROR = 0.001
"""Error of the closed forms of the drape (near corners), as a share of the height. A finer scale of
the residual would only exclude the edges, which determine the size."""
RISE_ERROR = 0.005
"""The same on a curved membrane, as a share of its rise from corner to corner: the drape beside a
corner is that of the nearest place."""
EDGES_MM = (0.0, 0.1, 0.2, 0.35, 0.6, 1.0)
"""Fillets that are compared with the fitted one; larger ones are not fitted."""
THINNED = 8
"""For the comparison, one of so many points is enough."""
CORNER_SD = 0.05
"""Strength of a corner's rounding, either sign: a sharp corner holds the membrane further out."""
CORNER_MM = 0.6
"""Pixels closer to a corner are not used: the strength alone does not describe the shape there."""
MOST_ROUNDS = 6
"""Rounds of reweighting before a fit counts as not converged."""
SURE = 2.0
"""Standard deviations by which another fillet must be more likely than a usual one."""
GOOD_RESIDUAL, SMALL_RESIDUAL = 0.005, 0.02
"""Residuals, as shares of the height, up to which no other shape is tried, and up to which no
cuboid is: its corners alone cause a residual several times as large as the first limit."""
EDGE_RADIUS_MM = 0.08
"""Fillet of an object's edge if the map does not show it, known to half of itself: edges of printed
and machined indenters have 0.05 to 0.1 mm."""
SETTLED = 0.3
"""Rounds stop when no parameter moves by more than this share of its sd."""


@dataclass(frozen=True, slots=True)
class EdgePrior:
    """Prior knowledge of the rounding of an edge.

    The fillet of the object and the blur of the map both round the wall's upper end, but only the
    fillet moves the wall inwards. If the map tells them apart, the map decides; otherwise this
    prior does, and the sizes are uncertain by all of `EDGES_MM` that fit as well.

    Attributes
    ----------
    edge_radius_mm, edge_radius_sd_mm : float
        Fillet of a usual object.
    blur_mm2, blur_sd_mm2 : float
        Variance of the map's blur, in which the map is linear, and what is not known of it.
    blur_known : bool
        Whether the blur follows from nodes and image, so that the map can show another fillet.
    stated : bool
        Whether the fillet was stated: then it is kept, and another one is only reported.
    """

    edge_radius_mm: float
    edge_radius_sd_mm: float
    blur_mm2: float
    blur_sd_mm2: float
    blur_known: bool
    stated: bool = False


def unknown_edge(window: FitWindow) -> EdgePrior:
    """Return the prior where neither the object's edge nor the map's blur is known."""
    # The standard deviation of a squared blur of which nothing is known is (0.1 mm)^2.
    return EdgePrior(
        EDGE_RADIUS_MM, 0.5 * EDGE_RADIUS_MM, window.pitch_mm**2, 0.1**2, blur_known=False
    )


@dataclass(frozen=True, slots=True)
class IndenterFit:
    """Fit of an indenter to a height map: parameters, residual and rival shapes.

    Attributes
    ----------
    shape : str
        The shape that was fitted.
    edge : EdgePrior
        What was known of its edge.
    values, sd : dict
        Parameters and their standard deviations (mm, radians), with the baseline. They follow from
        the residual: noise and everything that the shape does not explain.
    chosen : (rows, columns) bool
        The N pixels that were fitted.
    gain : (parameters, N)
        Change of each parameter per unit change of the depth of these pixels.
    residual_mm : (rows, columns)
        Map minus model over the window; NaN where not used.
    residual_rms_mm : float
        Root of the weighted mean square.
    correlated_pixels : float
        How many neighbouring pixels have a common error.
    converged : bool
        Whether the solver converged.
    other_edge_mm : float or None
        The fillet that the map shows in place of the stated one.
    face : (rows, columns) bool or None
        The pixels of the object's face; None for a ball, which has none.
    rivals_mm : dict
        Residual (root mean square) of each other shape that was tried.
    """

    shape: str
    edge: EdgePrior
    values: Mapping[str, float]
    sd: Mapping[str, float]
    chosen: BoolArray
    gain: Float64Array
    residual_mm: Float64Array
    residual_rms_mm: float
    correlated_pixels: float
    converged: bool
    other_edge_mm: float | None = None
    face: BoolArray | None = None
    rivals_mm: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def plateau_shift_mm(self) -> float:
        """Median height of the face minus the fitted height.

        The fit uses the edge of the plateau, where a reconstruction is least accurate. The height
        of the object is that of its face.
        """
        if self.face is None or not self.face.any():
            return 0.0
        return float(np.median(self.residual_mm[self.face]))


@dataclass(frozen=True, slots=True)
class _IndenterProblem:
    """Least-squares problem of an indenter fit: points, parameters and priors."""

    model: IndenterModel
    names: tuple[str, ...]
    x_mm: Float64Array
    y_mm: Float64Array
    depth_mm: Float64Array
    prior: Mapping[str, tuple[float, float]]
    centre_mm: tuple[float, float]

    def depth(self, vector: Float64Array, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        values = dict(zip(self.names, vector, strict=True))
        ground = (
            values["offset_mm"]
            + values["tilt_x"] * (x_mm - self.centre_mm[0])
            + values["tilt_y"] * (y_mm - self.centre_mm[1])
        )
        return np.asarray(self.model.depth(values, x_mm, y_mm) + ground)


def fit_object(shape: str, window: FitWindow, edge: EdgePrior) -> IndenterFit:
    """Fit an indenter, and other shapes if it leaves a residual.

    Parameters
    ----------
    shape : str
        A key of `MODELS`.
    window : FitWindow
        The object and the ground around it.
    edge : EdgePrior
        What is known of the object's edge.
    """
    fit = fit_indenter(shape, window, edge)
    if shape != "ball":
        sharp = MODELS[shape].depth({**fit.values, "blur_mm2": 0.0}, window.x_mm, window.y_mm)
        on_face = (sharp >= fit.values["height_mm"] - 1e-9) & (window.weight > 0.0)
        fit = replace(fit, face=np.asarray(on_face))
    share = fit.residual_rms_mm / fit.values["height_mm"]
    if share <= GOOD_RESIDUAL:
        return fit
    tried = [name for name in MODELS if name != "cuboid" or share > SMALL_RESIDUAL]
    return replace(fit, rivals_mm=residuals_of((n for n in tried if n != shape), window, edge))


def residuals_of(shapes: Iterable[str], window: FitWindow, edge: EdgePrior) -> dict[str, float]:
    """Return the residual (mm, root mean square) of each shape after one round of its fit."""
    return {
        shape: fit_indenter(shape, window, edge, most_rounds=1).residual_rms_mm for shape in shapes
    }


def fit_indenter(
    shape: str, window: FitWindow, edge: EdgePrior, *, most_rounds: int = MOST_ROUNDS
) -> IndenterFit:
    """Fit position, size, yaw, depth and drape of an indenter together.

    Weighted least squares with Huber weights. `edge` is the prior of the edge's fillet and the
    map's blur. Its weight depends on the number of independent errors in the data. If another
    of `EDGES_MM` is clearly more likely than a usual fillet, it is fitted freely, or reported if
    the fillet was stated. The standard deviations include the fillets that explain the map as well.

    Parameters
    ----------
    shape, window, edge
        As for :func:`fit_object`.
    most_rounds : int, optional
        Rounds of reweighting; one is enough to see whether a shape fits at all.
    """
    model = MODELS[shape].on(window.heightmap.at_rest)
    start = model.start(window.region)
    fit, others = _fit(model, window, start, edge, most_rounds)
    if others is None:
        return fit
    best = int(np.argmin(others.excess))
    changed = zip(fit.values.items(), others.changes[best], strict=True)
    start = {name: value + float(change) for (name, value), change in changed}
    other = edge.blur_known and others.excess[best] + SURE**2 < others.usual
    if edge.stated:
        return replace(fit, other_edge_mm=start["edge_radius_mm"] if other else None)
    if other:
        fit, others = _fit(
            model, window, start, replace(edge, edge_radius_sd_mm=EDGES_MM[-1]), most_rounds
        )
        assert others is not None
    spread = zip(fit.sd.items(), others.spread, strict=True)
    return replace(fit, sd={name: max(sd, float(size)) for (name, sd), size in spread})


@dataclass(frozen=True, slots=True)
class _FilletSensitivity:
    """Changes of a fit by other fillets.

    Attributes
    ----------
    changes : (edges, parameters)
        Changes of the parameters.
    excess : (edges,)
        Sums of squares beyond that of the fit, without the prior of the fillet.
    usual : float
        How far the fit's fillet is from a usual one, squared, in standard deviations.
    """

    changes: Float64Array
    excess: Float64Array
    usual: float

    @property
    def spread(self) -> Float64Array:
        """Root mean square change of each parameter over the fillets, by their likelihood."""
        # The fit itself is one of them, without a change.
        excess = np.append(self.excess, 0.0)
        likely = np.exp(0.5 * (excess.min() - excess))
        return np.asarray(np.sqrt(likely[:-1] @ self.changes**2 / likely.sum()))


def _fit(
    model: IndenterModel,
    window: FitWindow,
    start: Mapping[str, float],
    edge: EdgePrior,
    most_rounds: int,
) -> tuple[IndenterFit, _FilletSensitivity | None]:
    """Fit an indenter, and again with other fillets if it has one."""
    fitted_mask, density = _chosen_points(window)
    names = (*model.names, *BASELINE)
    prior = _priors(model, edge)
    problem = _IndenterProblem(
        model,
        names,
        window.x_mm[fitted_mask],
        window.y_mm[fitted_mask],
        window.depth_mm[fitted_mask],
        prior,
        (start["x_mm"], start["y_mm"]),
    )
    first = dict.fromkeys(BASELINE, 0.0) | {k: m for k, (m, _) in prior.items()} | dict(start)
    vector = np.array([first[name] for name in names])
    weight = window.weight[fitted_mask]
    least_together = max(np.pi * (window.reach_mm / window.pitch_mm) ** 2, 1.0)
    # Until the residuals are known, a twentieth of the height is used as their scale.
    sigma, together, robust = 0.05 * start["height_mm"], 30.0, np.ones(weight.shape)
    for n in range(most_rounds):
        before = vector
        inflation = 1.0 + (together - 1.0) * density
        clear = _clear_of_corners(problem, vector)
        scale = np.sqrt(weight * robust * clear / inflation) / sigma
        vector, jacobian, converged = _solve(problem, vector, scale)
        residual_at_points = problem.depth_mm - problem.depth(vector, problem.x_mm, problem.y_mm)
        least = math.hypot(
            MODEL_ERROR * start["height_mm"],
            RISE_ERROR
            * _rise(window.heightmap.at_rest, model.corners(dict(zip(names, vector, strict=True)))),
        )
        weighted = residual_at_points * np.sqrt(weight)
        sigma = max(robust_sd(weighted - np.median(weighted)), least)
        ratio = np.abs(weighted) / (HUBER * sigma)
        robust = 1.0 / np.maximum(ratio, 1.0)
        residual = window.depth_mm - problem.depth(vector, window.x_mm, window.y_mm)
        residual = np.where(window.weight > 0.0, residual, np.nan)
        together = max(correlated_pixels(residual), least_together)
        actual = 1.0 + (together - 1.0) * density
        covariance = _covariance(jacobian, inflation, actual, len(prior))
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        # The standard deviations of the first round follow from an estimate of the residual's
        # scale.
        settled = n > 0 and bool(np.all(np.abs(vector - before) <= SETTLED * sd + 1e-5))
        if settled:
            break
    fit = IndenterFit(
        shape=model.shape,
        edge=edge,
        values=dict(zip(names, map(float, vector), strict=True)),
        sd=dict(zip(names, map(float, sd), strict=True)),
        chosen=fitted_mask,
        gain=np.linalg.pinv(jacobian.T @ jacobian) @ jacobian[: scale.size].T * scale,
        residual_mm=residual,
        residual_rms_mm=_weighted_rms(residual, window.weight),
        correlated_pixels=together,
        converged=converged and settled,
    )
    edged = most_rounds > 1 and "edge_radius_mm" in names
    return fit, _other_edges(problem, vector, scale) if edged else None


def _other_edges(
    problem: _IndenterProblem, vector: Float64Array, scale: Float64Array
) -> _FilletSensitivity:
    """Fit again with each of `EDGES_MM`, and freely from the best, with the last weights."""
    thin, place = np.s_[::THINNED], problem.names.index("edge_radius_mm")
    scale = np.sqrt(THINNED) * scale[thin]
    points = {name: getattr(problem, name)[thin] for name in ("x_mm", "y_mm", "depth_mm")}
    other_priors = {k: p for k, p in problem.prior.items() if k != "edge_radius_mm"}

    def squares(vector: Float64Array) -> float:
        few = replace(problem, **points)
        residual = (few.depth(vector, few.x_mm, few.y_mm) - few.depth_mm) * scale
        off = [
            (vector[problem.names.index(k)] - mean) / sd for k, (mean, sd) in other_priors.items()
        ]
        return float(residual @ residual + np.square(off).sum())

    def fitted(start: Float64Array, edge_mm: float, sd_mm: float = 1e-4) -> Float64Array:
        prior = other_priors | {"edge_radius_mm": (edge_mm, sd_mm)}
        return _solve(replace(problem, prior=prior, **points), start, scale)[0]

    # The few points have their own noise, also with the fillet of the fit.
    unchanged = fitted(vector, vector[place])
    vectors = [fitted(unchanged, edge_mm) for edge_mm in EDGES_MM]
    best = min(vectors, key=squares)
    vectors.append(fitted(best, best[place], EDGES_MM[-1]))
    excess = np.array([squares(other) for other in vectors]) - squares(unchanged)
    mean, sd = problem.prior["edge_radius_mm"]
    return _FilletSensitivity(
        np.array(vectors) - unchanged, excess, float(((vector[place] - mean) / sd) ** 2)
    )


def _clear_of_corners(problem: _IndenterProblem, vector: Float64Array) -> Float64Array:
    """Return 1 for points outside the reach of the corners, 0 for the others."""
    clear = np.ones(problem.x_mm.shape)
    for x, y in problem.model.corners(dict(zip(problem.names, vector, strict=True))):
        clear[np.hypot(problem.x_mm - x, problem.y_mm - y) < CORNER_MM] = 0.0
    return clear


def correlated_pixels(residual_mm: Float64Array) -> float:
    """Return how many pixels share one error: the sum of the residual's autocorrelation.

    The sum runs over lags up to where the correlation is first lost; 1 for white noise.

    Parameters
    ----------
    residual_mm : (rows, columns)
        Residuals; NaN where there are none.
    """
    # A stride saves most of the time; correlations extend over many pixels.
    # Pixels along a side of the map for the correlation of residuals.
    stride = max(1, round(max(residual_mm.shape) / 250))
    residual_mm = residual_mm[::stride, ::stride]
    valid_mask = np.isfinite(residual_mm)
    values = np.where(valid_mask, residual_mm, 0.0)
    values = np.where(valid_mask, values - values.sum() / max(valid_mask.sum(), 1), 0.0)
    rows, columns = (next_fast_len(2 * n, real=True) for n in values.shape)

    def correlate(a: Float64Array) -> Float64Array:
        spectrum = rfft2(a, (rows, columns))
        return np.asarray(irfft2(np.abs(spectrum) ** 2, (rows, columns)))

    pairs = correlate(valid_mask.astype(float))
    rho = correlate(values) / np.maximum(pairs, 0.5)
    if rho[0, 0] <= 0.0:
        return 1.0
    rho /= rho[0, 0]
    lag_y = np.minimum(np.arange(rows), rows - np.arange(rows))
    lag_x = np.minimum(np.arange(columns), columns - np.arange(columns))
    lag = np.round(np.hypot(lag_y[:, None], lag_x[None, :])).astype(int)
    # Beyond half the window pairs are few and the estimate is noise.
    reach = min(values.shape) // 2
    near = lag < reach
    sums = np.bincount(lag[near], rho[near], minlength=reach)
    counts = np.bincount(lag[near], minlength=reach)
    lost = np.flatnonzero(sums / np.maximum(counts, 1) < 0.05)
    end = int(lost[0]) if lost.size else reach
    return float(max(1.0 + stride**2 * (sums[:end].sum() - 1.0), 1.0))


def _chosen_points(window: FitWindow) -> tuple[BoolArray, float]:
    """Return the pixels of the fit, with their share of the usable ones.

    A regular decimation would alias with walls along the grid. This one is random with a fixed
    seed, so that a map always gives the same result.
    """
    usable = window.weight > 0.0
    draw = np.random.default_rng(0).random(usable.shape)
    fitted_mask = np.zeros(usable.shape, dtype=bool)
    for part, count in ((window.near_wall, EDGE_POINTS), (~window.near_wall, OTHER_POINTS)):
        area = usable & part
        fitted_mask |= area & (draw * max(int(area.sum()), 1) < count)
    return fitted_mask, float(fitted_mask.sum() / max(int(usable.sum()), 1))


def _priors(model: IndenterModel, edge: EdgePrior) -> dict[str, tuple[float, float]]:
    if "edge_radius_mm" not in model.names:
        return {}
    return {
        "edge_radius_mm": (edge.edge_radius_mm, edge.edge_radius_sd_mm),
        "blur_mm2": (edge.blur_mm2, edge.blur_sd_mm2),
    } | ({"corner_rounding": (0.0, CORNER_SD)} if "corner_rounding" in model.names else {})


def _bounds(names: tuple[str, ...], start: Float64Array) -> tuple[Float64Array, Float64Array]:
    low = np.full(len(names), -np.inf)
    high = np.full(len(names), np.inf)
    for k, name in enumerate(names):
        if name in ("diameter_mm", "side_a_mm", "side_b_mm"):
            low[k], high[k] = SMALLEST_SIZE_MM, 20.0 * max(start[k], SMALLEST_SIZE_MM)
        elif name == "height_mm":
            low[k], high[k] = 0.2 * start[k], 3.0 * start[k]
        elif name == "drape_decay_mm":
            low[k], high[k] = 0.05, 5.0
        elif name == "edge_radius_mm":
            low[k], high[k] = 1e-3, EDGES_MM[-1]
        elif name == "blur_mm2":
            low[k], high[k] = 0.0, 0.25
    return low, high


def _solve(
    problem: _IndenterProblem, vector: Float64Array, scale: Float64Array
) -> tuple[Float64Array, Float64Array, bool]:
    """Return the parameters, the Jacobian of the scaled residuals, and the convergence."""
    keys = list(problem.prior)
    positions = [problem.names.index(key) for key in keys]
    means = np.array([problem.prior[key][0] for key in keys])
    widths = np.array([problem.prior[key][1] for key in keys])

    def residuals(p: Float64Array) -> Float64Array:
        data = (problem.depth(p, problem.x_mm, problem.y_mm) - problem.depth_mm) * scale
        return np.concatenate([data, (p[positions] - means) / widths])

    low, high = _bounds(problem.names, vector)
    inside = np.clip(vector, low + 1e-9, high - 1e-9)

    level, *tilts = (problem.names.index(name) for name in BASELINE)
    curved = [k for k, name in enumerate(problem.names) if name not in BASELINE]

    def jacobian(p: Float64Array) -> Float64Array:
        slopes = forward_differences(residuals, p, curved)
        slopes[: scale.size, level] = scale
        slopes[: scale.size, tilts[0]] = scale * (problem.x_mm - problem.centre_mm[0])
        slopes[: scale.size, tilts[1]] = scale * (problem.y_mm - problem.centre_mm[1])
        return slopes

    # Relative change of the cost at which the fit of a round ends. The next round starts from
    # there.
    fit = fit_least_squares(residuals, jacobian, inside, (low, high), tolerance=1e-4)
    assert fit.slopes is not None, "the fit is not robust in itself"
    return fit.x, fit.slopes, fit.converged


def _covariance(jacobian: Float64Array, used: float, actual: float, priors: int) -> Float64Array:
    """Return the covariance, the data's part rescaled to the residual's actual correlation."""
    data = jacobian[: len(jacobian) - priors]
    prior = jacobian[len(jacobian) - priors :]
    return np.asarray(np.linalg.pinv(data.T @ data * (used / actual) + prior.T @ prior))


def _rise(surface: MembraneShape, places_mm: Float64Array) -> float:
    """Return how much a membrane rises from the lowest to the highest of (N, 2) places."""
    return float(np.ptp(surface.height(places_mm))) if len(places_mm) else 0.0


def _weighted_rms(residual: Float64Array, weight: Float64Array) -> float:
    valid_mask = np.isfinite(residual)
    total = float(weight[valid_mask].sum())
    return float(
        np.sqrt((weight[valid_mask] * residual[valid_mask] ** 2).sum() / max(total, 1e-12))
    )
