"""Fitting an indenter with its drape to the slopes of a map.

Errors of slopes are nearly white, those of depth are correlated over the whole object. The rounding
of an edge and the blur of the map therefore differ without knowledge of the object. What is known
of the blur of the image, from the board's edges, helps where the slopes alone do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.least_squares import fit_least_squares
from gelpolight_core.health.fault_limits import SIGMAS

from .indenter_models import MODELS, SMALLEST_SIZE_MM, IndenterModel, WallPlaces
from .interpolation import sample_bilinear
from .map_slopes import MapSmoothing, smoothing_of
from .segmentation import FitWindow

WALL_POINTS, OTHER_POINTS = 6000, 4000
"""Nodes of the fit near the wall and elsewhere. More only take more time."""
BESIDE = ((1, 0), (-1, 0), (0, 1), (0, -1))
FEWEST_NODES = 200
"""Fewest nodes that show a shape: ten for each parameter, at two distances from the wall."""
INSIDE_MM = 2.0
"""How far inside a wall its profile begins: the largest fillet, and blur beside it."""
TILT = ("tilt_x", "tilt_y")
"""Slope of the whole map."""
LARGEST_EDGE_MM = 1.0
EDGES_MM = (0.02, 0.06, 0.1, 0.15, 0.22, 0.35, 0.6)
"""Fillets with which the fit is tried. The most likely is its start, for towards 0 a fillet hardly
changes the slopes."""
FINE, ROUGH = 1e-6, 1e-3
"""Tolerances of a fit in a round, and of those that look for a start."""
THINNED, START_ROUNDS = 4, 2
"""Of the starts: one of so many nodes, and rounds of reweighting."""
HUBER = 2.0
"""Residuals beyond this many standard deviations lose weight."""
CORNER_MM = 0.6
"""Nodes closer to a corner are not used; with a larger fillet, the nodes where two of them meet."""
STEEP = 0.9
"""Quantile of the bend of the profile beyond which nodes show the error of the wall's place."""
SQUARES = 1.0 / math.log(2.0)
"""Mean of the squares of two normal errors, over its median."""
LEAST_SEEN = 20
"""Nodes whose mean residual at one distance from the wall is known."""
AT_EDGE = 4
"""Parameters that the profile of an edge alone determines: size, height, fillet and blur."""
MOST_ROUNDS = 12
SETTLED = 0.1
"""Rounds stop when no parameter moves by more than this share of its standard deviation."""
SURE = 2.0
"""Standard deviations by which another fillet differs from a stated one."""
GOOD_RESIDUAL, SMALL_RESIDUAL = 0.005, 0.02
"""Residuals, as shares of the height, up to which no other shape is tried, and up to which no
cuboid is: its corners alone cause a residual several times as large as the first limit."""


class Known(NamedTuple):
    """What is known of a parameter, and its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True, slots=True)
class IndenterFit:
    """Fit of an indenter to a height map: parameters, residual and rival shapes.

    Attributes
    ----------
    shape : str
        The shape that was fitted.
    values, sd : dict
        Parameters and their standard deviations (mm, radians), with level and tilt of the map. They
        follow from the residual: noise, and the mean residual along the wall.
    x_mm, y_mm : (N,)
        The nodes that were fitted.
    names : tuple of str
        The fitted parameters.
    gain : (parameters, 2, N)
        Change of each of `names` per unit change of the slopes of these nodes.
    blur_mm : float
        Blur of the map, a standard deviation.
    residual_mm : (rows, columns)
        Depth minus model over the window; NaN where not used.
    residual_rms_mm : float
        Root of the weighted mean square.
    converged : bool
        Whether the rounds settled.
    other_edge_mm : float or None
        The fillet that the map shows in place of the stated one.
    more_blur_mm : float
        Blur of the walls beyond that of the camera at calibration, 0 where it is within its
        deviation or not known.
    face : (rows, columns) bool or None
        The nodes of the object's face; None for a ball, which has none.
    rivals_mm : dict
        Residual (root mean square) of each other shape that was tried.
    """

    shape: str
    values: Mapping[str, float]
    sd: Mapping[str, float]
    names: tuple[str, ...]
    x_mm: Float64Array
    y_mm: Float64Array
    gain: Float64Array
    blur_mm: float
    residual_mm: Float64Array
    residual_rms_mm: float
    converged: bool
    other_edge_mm: float | None = None
    more_blur_mm: float = 0.0
    face: BoolArray | None = None
    rivals_mm: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def plateau_shift_mm(self) -> float:
        """Median depth of the face minus the fitted height."""
        if self.face is None or not self.face.any():
            return 0.0
        return float(np.median(self.residual_mm[self.face]))


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Nodes of a fit (N,), their slopes (2, N) and weight, and their share of all."""

    x_mm: Float64Array
    y_mm: Float64Array
    slopes: Float64Array
    weight: Float64Array
    share: float

    def every(self, step: int) -> _Nodes:
        return _Nodes(
            self.x_mm[::step],
            self.y_mm[::step],
            self.slopes[:, ::step],
            self.weight[::step],
            self.share / step,
        )


class _Derivatives(NamedTuple):
    """Derivatives (parameters, 2, N) of slopes, and distance and bend (N,) of the profile."""

    by: Float64Array
    outwards: Float64Array
    beyond_mm: Float64Array
    bend: Float64Array


@dataclass(frozen=True, slots=True)
class _SlopeProblem:
    """Least-squares problem of a fit: nodes, and the slopes that parameters give them."""

    model: IndenterModel
    names: tuple[str, ...]
    nodes: _Nodes
    smoothing: MapSmoothing
    known: Mapping[str, Known]

    def named(self, vector: Float64Array) -> dict[str, float]:
        return dict(zip(self.names, vector.tolist(), strict=True))

    @property
    def known_rows(self) -> tuple[Float64Array, Float64Array]:
        """Rows (known, parameters) and values of what is known, over its deviations."""
        rows = np.zeros((len(self.known), len(self.names)))
        for row, (name, known) in zip(rows, self.known.items(), strict=True):
            row[self.names.index(name)] = 1.0 / known.sd
        return rows, np.array([known.value / known.sd for known in self.known.values()])

    def slopes(self, vector: Float64Array) -> Float64Array:
        """Return the slopes (2, N) without `rest`."""
        values = self.named(vector)
        places = self.model.places(values, self.nodes.x_mm, self.nodes.y_mm)
        (slope,) = self._at(self._profile(values, places)[None], places)
        return np.asarray(slope * places.outwards + np.array([[values[name]] for name in TILT]))

    def derivatives(self, vector: Float64Array) -> _Derivatives:
        """Return the derivatives of `slopes`.

        Place, yaw and size move a node along the profile and turn the profile's direction. On a
        curved membrane they change the profile, too.
        """
        values, (x_mm, y_mm) = self.named(vector), (self.nodes.x_mm, self.nodes.y_mm)
        places = self.model.places(values, x_mm, y_mm)
        outwards = places.outwards
        aside = np.stack([-outwards[1], outwards[0]])
        base = self._profile(values, places)
        table = {"": base, "bend": np.gradient(base, self.smoothing.step_mm, axis=1)}
        for name in self.model.names:
            if name not in ("x_mm", "y_mm", "yaw") or len(base) > 1:
                step = 1e-5 * max(abs(values[name]), 0.01)
                if name == "edge_radius_mm":
                    # Towards 0 a fillet hardly changes the slopes: what matters is one of a node.
                    step = max(step, self.smoothing.node_mm - values[name])
                moved = self._profile({**values, name: values[name] + step}, places)
                table[name] = (moved - base) / step
        slope, bend, *changes = self._at(np.stack([*table.values()]), places)
        by = np.zeros((len(self.names), *outwards.shape))
        for name, change in zip([*table][2:], changes, strict=True):
            wall = places.walls.get(name, 0.0)
            by[self.names.index(name)] = (change - 0.5 * wall * bend) * outwards
        for axis, name in enumerate(("x_mm", "y_mm")):
            turned = slope * places.turning * aside[axis] * aside
            by[self.names.index(name)] -= bend * outwards[axis] * outwards + turned
            by[self.names.index(TILT[axis]), axis] = 1.0
        if "yaw" in values:
            along_mm = aside[0] * (x_mm - values["x_mm"]) + aside[1] * (y_mm - values["y_mm"])
            by[self.names.index("yaw")] += bend * along_mm * outwards + slope * aside
        return _Derivatives(by, outwards, places.beyond_mm, bend)

    def rest(self, vector: Float64Array) -> Float64Array:
        """Return the slopes (2, N) along the wall, and those that corners add.

        The first occur on a curved membrane only; the second are those on a flat one.
        """
        x, y, values = self.nodes.x_mm, self.nodes.y_mm, self.named(vector)
        half, model = 0.5 * self.smoothing.node_mm, self.model
        added = [model.by_corners(values, x + half * i, y + half * j) for i, j in BESIDE]
        rest = np.stack([added[0] - added[1], added[2] - added[3]]) / (2.0 * half)
        if model.flat:
            return rest
        places = model.places(values, x, y)
        depths = model.line(values, self._ends(places)[1:] - 0.5 * self.smoothing.step_mm)
        rows = np.minimum(places.row.astype(np.intp), len(depths) - 2)
        apart = places._replace(row=rows.astype(np.float64))
        (change,) = self._at(np.diff(depths, axis=0, append=depths[-1:])[None], apart)
        aside = np.stack([-places.outwards[1], places.outwards[0]])
        return np.asarray(rest + change * places.rows_per_mm * aside)

    def used(self, vector: Float64Array) -> BoolArray:
        """Return which nodes are outside the reach of the corners."""
        values, x, y = self.named(vector), self.nodes.x_mm, self.nodes.y_mm
        reach_mm = max(CORNER_MM, math.sqrt(2.0) * values.get("edge_radius_mm", 0.0))
        used = np.ones(x.shape, dtype=bool)
        for corner_x, corner_y in self.model.corners(values):
            used &= np.hypot(x - corner_x, y - corner_y) >= reach_mm
        return used

    def _ends(self, places: WallPlaces) -> Float64Array:
        """Return distances from the wall between which the slopes of a profile are.

        A wall that is tried far away from all nodes has no slope there.
        """
        step_mm, nodes = self.smoothing.step_mm, self.nodes
        most_mm = 2.0 * math.hypot(np.ptp(nodes.x_mm), np.ptp(nodes.y_mm))
        end_mm = min(float(places.beyond_mm.max()), most_mm)
        return np.arange(-INSIDE_MM, end_mm + 3.0 * step_mm, step_mm)

    def _profile(self, values: Mapping[str, float], places: WallPlaces) -> Float64Array:
        """Return the map's slopes along lines across the wall."""
        slopes = np.diff(self.model.line(values, self._ends(places)), axis=1)
        slopes /= self.smoothing.step_mm
        return self.smoothing.smoothed(slopes, values["blur_mm2"])

    def _at(self, tables: Float64Array, places: WallPlaces) -> Float64Array:
        """Return profiles (tables, rows, n) at places relative to the wall."""
        column = (places.beyond_mm + INSIDE_MM) / self.smoothing.step_mm - 0.5
        if tables.shape[1] > 1:
            return sample_bilinear(tables, places.row, column)
        column = np.clip(column, 0.0, tables.shape[2] - 1.001)
        k = column.astype(np.intp)
        low = tables[:, 0, k]
        return np.asarray(low + (column - k) * (tables[:, 0, k + 1] - low))


class _Round(NamedTuple):
    """A round of a fit.

    Attributes
    ----------
    vector : (parameters,)
        The parameters.
    residual : (2, N)
        Slopes of the map less those of the model.
    derivatives : _Derivatives
        Derivatives of the model.
    weight : (N,)
        Squared weights of the nodes: by their standard deviations, and against outliers.
    step : (parameters,)
        How far the round has moved the parameters.
    """

    vector: Float64Array
    residual: Float64Array
    derivatives: _Derivatives
    weight: Float64Array
    step: Float64Array


def fit_object(shape: str, window: FitWindow, edge: Known | None = None) -> IndenterFit:
    """Fit an indenter, and other shapes if it leaves a residual.

    Parameters
    ----------
    shape : str
        A key of `MODELS`.
    window : FitWindow
        The object and the ground around it.
    edge : Known, optional
        The fillet of the object's edge in mm, if it was stated.
    """
    fit = fit_indenter(shape, window, edge)
    if edge is not None:
        free = fit_indenter(shape, window)
        found_mm, sd_mm = free.values["edge_radius_mm"], free.sd["edge_radius_mm"]
        if abs(found_mm - edge.value) > SURE * math.hypot(sd_mm, edge.sd):
            fit = replace(fit, other_edge_mm=found_mm)
    share = fit.residual_rms_mm / fit.values["height_mm"]
    if share <= GOOD_RESIDUAL:
        return fit
    tried = [name for name in MODELS if name != "cuboid" or share > SMALL_RESIDUAL]
    return replace(fit, rivals_mm=residuals_of((n for n in tried if n != shape), window))


def residuals_of(shapes: Iterable[str], window: FitWindow) -> dict[str, float]:
    """Return the residual (mm, root mean square) of each shape after a short fit."""
    return {
        shape: fit_indenter(shape, window, most_rounds=START_ROUNDS).residual_rms_mm
        for shape in shapes
    }


def fit_indenter(
    shape: str,
    window: FitWindow,
    edge: Known | None = None,
    *,
    most_rounds: int = MOST_ROUNDS,
) -> IndenterFit:
    """Fit position, size, yaw, height, edge, drape and blur of an indenter together.

    Parameters
    ----------
    shape, window, edge
        As for :func:`fit_object`.
    most_rounds : int, optional
        Rounds of reweighting; few are enough to see whether a shape fits at all.
    """
    model = MODELS[shape].on(window.heightmap.at_rest)
    names = (*model.names, *TILT)
    smoothing = smoothing_of(window.heightmap)
    known = {} if smoothing.image_blur is None else {"blur_mm2": Known(*smoothing.image_blur)}
    if edge is not None:
        known["edge_radius_mm"] = edge
    problem = _SlopeProblem(model, names, _chosen_nodes(window), smoothing, known)
    thin = replace(problem, nodes=problem.nodes.every(THINNED))
    begin = {**dict.fromkeys(names, 0.0), **model.start(window.region)}
    begin["blur_mm2"] = (0.5 * window.pitch_mm) ** 2
    vector = np.array([begin[name] for name in names])
    unknown, held = np.zeros(vector.size), None
    if edge is not None:
        held = names.index("edge_radius_mm")
        vector[held] = edge.value
    elif "edge_radius_mm" in names:
        others, likely = _with_fillets(thin, vector, names.index("edge_radius_mm"))
        vector = others[int(np.argmax(likely))]
        unknown = likely @ (others - likely @ others) ** 2
    found = _fit(problem, vector, most_rounds, held=held)
    return _finished(problem, found, window, unknown)


def _with_fillets(
    problem: _SlopeProblem, vector: Float64Array, at: int
) -> tuple[Float64Array, Float64Array]:
    """Return the fits with each of `EDGES_MM`, held at parameter `at`, and their likelihoods.

    Where nodes and blur do not show a fillet, several are as likely, and the deviations show it.
    """
    tried, costs, level, (rows, means) = [], [], 0.0, problem.known_rows
    for edge_mm in EDGES_MM:
        vector = vector.copy()
        vector[at] = edge_mm
        found = _fit(problem, vector, START_ROUNDS, held=at)
        vector, squares = found.vector, np.sum(found.residual**2, axis=0)[found.weight > 0.0]
        level = level or float(np.median(squares))
        tried.append(vector)
        off = rows @ vector - means
        robust = 2.0 / SQUARES * float(np.sum(np.sqrt(1.0 + squares / level) - 1.0))
        costs.append(robust + 0.5 * float(off @ off))
    likely = np.exp(min(costs) - np.array(costs)) * np.gradient(EDGES_MM)
    return np.array(tried), likely / likely.sum()


def _chosen_nodes(window: FitWindow) -> _Nodes:
    """Return the nodes of the fit.

    A regular decimation would alias with walls along the grid. This one is random with a fixed
    seed, so that a map always gives the same result.
    """
    usable = (window.weight > 0.0) & window.known
    draw = np.random.default_rng(0).random(usable.shape)
    chosen = np.zeros(usable.shape, dtype=bool)
    for part, count in ((window.near_wall, WALL_POINTS), (~window.near_wall, OTHER_POINTS)):
        area = usable & part
        chosen |= area & (draw * max(int(area.sum()), 1) < count)
    if chosen.sum() < FEWEST_NODES:
        text = f"only {int(chosen.sum())} nodes near the object have a known slope"
        raise InputError(text, "depth map", Remedy.PRESS_MIDDLE)
    slopes = window.slopes[:, chosen]
    share = float(chosen.sum() / max(int(usable.sum()), 1))
    return _Nodes(window.x_mm[chosen], window.y_mm[chosen], slopes, window.weight[chosen], share)


def _fit(
    problem: _SlopeProblem, vector: Float64Array, most_rounds: int, *, held: int | None = None
) -> _Round:
    """Fit in rounds, each with weights by the residuals of the one before.

    `held` is a parameter that is not changed.
    """
    tolerance = ROUGH if most_rounds == START_ROUNDS else FINE
    nodes, low_high = problem.nodes, _bounds(problem.names, vector)
    if held is not None:
        for limit in low_high:
            limit[held] = vector[held]
    weight = nodes.weight / np.median(np.sum((problem.slopes(vector) - nodes.slopes) ** 2, axis=0))
    found: _Round | None = None
    for _ in range(most_rounds):
        rest = problem.rest(vector) - nodes.slopes
        used = problem.used(vector)
        moved = _solved(problem, vector, low_high, rest, np.sqrt(weight * used), tolerance)
        residual = -(problem.slopes(moved) + rest)
        by = problem.derivatives(moved)
        weight = _weights(residual, nodes.weight * used)
        sd = np.sqrt(np.maximum(np.diag(_covariance(problem, by.by, weight)), 0.0))
        found = _Round(moved, residual, by, weight, np.abs(moved - vector))
        vector = moved
        if _settled(found.step, sd):
            break
    assert found is not None, "no round was asked for"
    return found


def _settled(step: Float64Array, sd: Float64Array) -> bool:
    """Return whether a round has moved no parameter by more than its deviation allows."""
    return bool(np.all(step <= SETTLED * sd + 1e-6))


def _solved(
    problem: _SlopeProblem,
    vector: Float64Array,
    bounds: tuple[Float64Array, Float64Array],
    rest: Float64Array,
    scale: Float64Array,
    tolerance: float,
) -> Float64Array:
    """Return the parameters of least squares with weights and the rest of the slopes as given."""
    rows, means = problem.known_rows

    def residuals(p: Float64Array) -> Float64Array:
        return np.append((problem.slopes(p) + rest) * scale, rows @ p - means)

    def jacobian(p: Float64Array) -> Float64Array:
        by = (problem.derivatives(p).by * scale).reshape(p.size, -1)
        return np.concatenate([by.T, rows])

    # On a curved membrane the derivatives take most of the time; in a round they change little.
    at_start = None if problem.model.flat else jacobian(vector)
    slopes = jacobian if at_start is None else lambda _: at_start
    return fit_least_squares(residuals, slopes, vector, bounds, tolerance=tolerance).x


def _weights(residual: Float64Array, usable: Float64Array) -> Float64Array:
    """Return squared weights of nodes by their residuals."""
    squares = 0.5 * np.sum(residual**2, axis=0)
    level = SQUARES * float(np.median(squares[usable > 0.0])) + 1e-12
    off = np.sqrt(squares / level)
    return np.asarray(usable / level / np.maximum(off / HUBER, 1.0))


def _variance(found: _Round) -> Float64Array:
    """Return the variance of each node's slopes: as of calm ones, and by the wall's place."""
    squares, bend2 = 0.5 * np.sum(found.residual**2, axis=0), found.derivatives.bend**2
    used = found.weight > 0.0
    calm = used & (bend2 <= np.median(bend2[used]))
    steep = used & (bend2 >= max(float(np.quantile(bend2[used], STEEP)), 1e-9))
    level = SQUARES * float(np.median(squares[calm])) + 1e-12
    if not steep.any():
        return np.full_like(squares, level)  # no node is at a wall
    more = squares[steep].mean() - level
    return level + max(float(more / bend2[steep].mean()), 0.0) * bend2


def _covariance(problem: _SlopeProblem, by: Float64Array, weight: Float64Array) -> Float64Array:
    slopes = (by * np.sqrt(weight)).reshape(len(by), -1)
    information = slopes @ slopes.T
    rows, _ = problem.known_rows
    information += rows.T @ rows
    if "edge_radius_mm" in problem.names:
        # Any fillet is between 0 and the largest.
        at = problem.names.index("edge_radius_mm")
        information[at, at] += 12.0 / LARGEST_EDGE_MM**2
    return np.asarray(np.linalg.pinv(information))


def _along_wall(problem: _SlopeProblem, found: _Round, gain: Float64Array) -> Float64Array:
    """Return the covariance of the parameters by errors that are equal all along the wall.

    Such errors are those of the model: noise has no mean over the nodes at one distance from the
    wall. Their size at an edge is known from what is left of the freedom of the profile.
    """
    node_mm, by = problem.smoothing.node_mm, found.derivatives
    use = found.weight > 0.0
    from_first_mm = by.beyond_mm[use] - by.beyond_mm[use].min()
    at = np.unique(np.round(from_first_mm / node_mm), return_inverse=True)[1]
    weight, normal = found.weight[use], np.sum(found.residual * by.outwards, axis=0)[use]
    counts, total = np.bincount(at), np.bincount(at, weight)
    seen = counts >= LEAST_SEEN
    total = np.where(seen, total, 1.0)
    mean2 = (np.bincount(at, weight * normal) / total) ** 2 - 1.0 / total
    bend2 = np.bincount(at, weight * by.bend[use] ** 2) / total
    edge = seen & (bend2 > (1.0 - STEEP) * bend2[seen].max())
    free = max(int(edge.sum()) - AT_EDGE, 1) / max(int(edge.sum()), 1)
    bends2 = float(bend2[edge].sum())
    place_mm2 = max(float(mean2[edge].sum()) / bends2, 0.0) / free if bends2 else 0.0
    error2 = np.where(edge, place_mm2 * bend2, np.where(seen, np.maximum(mean2, 0.0), 0.0))
    each = np.einsum("pan,an->pn", gain[..., use], by.outwards[:, use])
    common = np.stack([np.bincount(at, row, minlength=counts.size) for row in each])
    return np.asarray((common * error2) @ common.T)


def _within_largest_edge(problem: _SlopeProblem, covariance: Float64Array) -> Float64Array:
    """Return the covariance with the knowledge that any fillet is between 0 and the largest.

    The fit's own covariance has it beside the scatter of the slopes; errors along the wall are
    larger, and would mean fillets of several mm.
    """
    if "edge_radius_mm" not in problem.names:
        return covariance
    at = problem.names.index("edge_radius_mm")
    with_edge = covariance[at]
    known = with_edge[at] + LARGEST_EDGE_MM**2 / 12.0
    return np.asarray(covariance - np.outer(with_edge, with_edge) / known)


def _finished(
    problem: _SlopeProblem, found: _Round, window: FitWindow, unknown: Float64Array
) -> IndenterFit:
    """Return a fit with its residual and its standard deviations.

    `unknown` are the variances of the parameters by other fillets.
    """
    values, model, nodes = problem.named(found.vector), problem.model, problem.nodes
    covariance = _covariance(problem, found.derivatives.by, found.weight)
    gain = np.einsum("pq,qan->pan", covariance, found.derivatives.by * found.weight)
    # Nodes whose slopes follow from one depth have a common error.
    together = 1.0 + nodes.share * (problem.smoothing.nodes_together - 1.0)
    scatter = np.einsum("pan,qan->pq", gain * _variance(found), gain) * together
    total = _within_largest_edge(problem, scatter + _along_wall(problem, found, gain))
    deviation = np.sqrt(np.maximum(np.diag(total) + unknown, 0.0))
    sd = dict(zip(problem.names, deviation.tolist(), strict=True))
    depth = model.depth(values, window.x_mm, window.y_mm)
    across, down = window.x_mm - values["x_mm"], window.y_mm - values["y_mm"]
    usable = window.weight > 0.0
    residual = window.depth_mm - depth - values["tilt_x"] * across - values["tilt_y"] * down
    level = float(np.median(residual[usable & window.ground]))
    residual = np.where(usable, residual - level, np.nan)
    face = None
    if "edge_radius_mm" in values:
        face = usable & (depth >= values["height_mm"] - 1e-9)
    squares = window.weight[usable] * residual[usable] ** 2
    return IndenterFit(
        shape=model.shape,
        values={**values, "offset_mm": level},
        blur_mm=math.sqrt(problem.smoothing.blur_mm2(values["blur_mm2"])),
        sd=sd,
        names=problem.names,
        x_mm=nodes.x_mm,
        y_mm=nodes.y_mm,
        gain=gain,
        residual_mm=residual,
        residual_rms_mm=math.sqrt(float(squares.sum() / window.weight[usable].sum())),
        # Reweighting ends slowly along an edge and a size that only together are certain.
        converged=_settled(found.step, deviation),
        more_blur_mm=_more_blur_mm(problem, values, sd),
        face=face,
    )


def _more_blur_mm(
    problem: _SlopeProblem, values: Mapping[str, float], sd: Mapping[str, float]
) -> float:
    """Return the blur beyond that of the camera at calibration, 0 where it is not clear.

    A map does not show less than half a node.
    """
    camera = problem.known.get("blur_mm2")
    if camera is None:
        return 0.0
    more_mm2 = values["blur_mm2"] - camera.value
    is_clear = more_mm2 > SIGMAS * math.hypot(sd["blur_mm2"], camera.sd)
    shown_mm2 = (0.5 * problem.smoothing.node_mm) ** 2
    return math.sqrt(more_mm2) if is_clear and more_mm2 > shown_mm2 else 0.0


def _bounds(names: tuple[str, ...], start: Float64Array) -> tuple[Float64Array, Float64Array]:
    values = dict(zip(names, start.tolist(), strict=True))
    most = {
        "height_mm": (0.2 * values["height_mm"], 3.0 * values["height_mm"]),
        "drape_decay_mm": (0.05, 5.0),
        "edge_radius_mm": (0.0, LARGEST_EDGE_MM),
        "blur_mm2": (0.0, 0.25),
    }
    for name in ("diameter_mm", "side_a_mm", "side_b_mm"):
        most[name] = SMALLEST_SIZE_MM, 20.0 * max(values.get(name, 0.0), SMALLEST_SIZE_MM)
    low, high = zip(*(most.get(name, (-np.inf, np.inf)) for name in names), strict=True)
    return np.array(low), np.array(high)
