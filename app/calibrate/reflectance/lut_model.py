"""The model of the curve editor: an immutable state, and functions that return the next state.

A state holds the nodes of the three channels, the fitted curves, and the outlines of the excluded
points. No function changes a state, so that undo only has to show an older one. Every curve stays
strictly increasing from no light to full light, so that it can be inverted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import channel_name
from gelpolight_core.errors import InputError
from gelpolight_core.reflectance.table import LEAST_STEP, ReflectanceTable, fit_channel
from gelpolight_core.translation import tr

T = TypeVar("T")
Array = NDArray[np.float64]
Outline = tuple[tuple[float, float], ...]
LEAST_NODES = 4
LEAST_GAP = 1e-3
"""Nodes closer in cosine than this cannot be separated with the pointer."""
TOLERANCE = 2e-3
"""Largest change of a curve by removing nodes, as a share of its highest value."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Nodes of one channel; two curves are equal if all their nodes are.

    Attributes
    ----------
    cosines, values : tuple of float
        Strictly increasing; cosines from 0 to 1, values from 0 or above.

    Raises
    ------
    ValueError
        If the nodes break these rules.
    """

    cosines: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Reject nodes that are not a reflectance curve."""
        cosines, values = np.asarray(self.cosines), np.asarray(self.values)
        if cosines.shape != values.shape or cosines.size < LEAST_NODES:
            raise ValueError(f"{cosines.size} cosines and {values.size} values")
        if not (np.isfinite(cosines).all() and np.isfinite(values).all()):
            raise ValueError("a node is not finite")
        if cosines[0] != 0.0 or cosines[-1] != 1.0 or values[0] < 0.0:
            raise ValueError("the curve does not run from cosine 0 to cosine 1")
        if (np.diff(cosines) <= 0.0).any() or (np.diff(values) <= 0.0).any():
            raise ValueError("the curve does not increase strictly")

    def at(self, cosine: Array | float) -> Array:
        """Return the values at cosines between 0 and 1."""
        return np.asarray(PchipInterpolator(self.cosines, self.values)(cosine))


@dataclass(frozen=True, slots=True)
class CurveEdit:
    """One state of the editor.

    Attributes
    ----------
    curves : tuple of 3 Curve
        Edited curves.
    fits : tuple of 3 Curve
        Fits to the points that are not excluded.
    coverage : tuple of 3 (low, high)
        Range of cosines that these points cover; outside of it the curve is extrapolated.
    left_out : tuple of 3 tuples of outlines
        Points inside any of a channel's outlines (cosine, value) are excluded.
    """

    curves: tuple[Curve, Curve, Curve]
    fits: tuple[Curve, Curve, Curve]
    coverage: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    left_out: tuple[tuple[Outline, ...], tuple[Outline, ...], tuple[Outline, ...]]

    def table(self) -> ReflectanceTable:
        """Return the edited curves as a reflectance table."""
        red, green, blue = self.curves
        return ReflectanceTable(
            (np.array(red.cosines), np.array(green.cosines), np.array(blue.cosines)),
            (np.array(red.values), np.array(green.values), np.array(blue.values)),
            np.array(self.coverage),
        )


def start_edit(table: ReflectanceTable) -> CurveEdit:
    """Return the initial state of the editor for a calibration's table."""
    curves = _three(
        [
            Curve(tuple(c.tolist()), tuple(v.tolist()))
            for c, v in zip(table.cosines, table.values, strict=True)
        ]
    )
    coverage = _three([(float(low), float(high)) for low, high in table.coverage])
    return CurveEdit(curves, curves, coverage, ((), (), ()))


def move_node(edit: CurveEdit, channel: int, index: int, cosine: float, value: float) -> CurveEdit:
    """Move a node as far as its neighbours allow; the end nodes keep their cosine."""
    curve = edit.curves[channel]
    cosines, values = list(curve.cosines), list(curve.values)
    last = len(cosines) - 1
    gap = _value_gap(curve)
    if 0 < index < last:
        cosines[index] = _between(cosine, cosines[index - 1], cosines[index + 1], LEAST_GAP)
    low = values[index - 1] if index > 0 else -gap
    high = values[index + 1] if index < last else np.inf
    values[index] = _between(value, low, high, gap)
    return _with_nodes(edit, channel, cosines, values)


def add_node(edit: CurveEdit, channel: int, cosine: float) -> tuple[CurveEdit, int]:
    """Add a node on the curve; return the new state and the index of the node.

    Raises
    ------
    InputError
        If there is a node already, or no room next to one.
    """
    curve = edit.curves[channel]
    cosines, values = list(curve.cosines), list(curve.values)
    index = int(np.searchsorted(cosines, cosine))
    inside = 0.0 < cosine < 1.0
    if not inside or min(cosine - cosines[index - 1], cosines[index] - cosine) < LEAST_GAP:
        raise InputError(
            tr("there is no room for a node at cosine {cosine:.3f}").format(cosine=cosine),
            where=tr("Reflectance curve"),
            advice=tr("Choose a position between two nodes"),
        )
    cosines.insert(index, cosine)
    values.insert(index, float(curve.at(cosine)))
    return _with_nodes(edit, channel, cosines, values), index


def remove_node(edit: CurveEdit, channel: int, index: int) -> CurveEdit:
    """Remove a node.

    Raises
    ------
    InputError
        If it is an end node, or too few nodes would remain.
    """
    curve = edit.curves[channel]
    if index in (0, len(curve.cosines) - 1):
        raise InputError(
            tr("the end nodes of the curve cannot be removed"),
            where=tr("Reflectance curve"),
            advice=tr("Move the node up or down instead"),
        )
    if len(curve.cosines) <= LEAST_NODES:
        raise InputError(
            tr("a curve needs at least {n} nodes").format(n=LEAST_NODES),
            where=tr("Reflectance curve"),
            advice=tr("Move the node instead"),
        )
    keep = [i for i in range(len(curve.cosines)) if i != index]
    cosines, values = curve.cosines, curve.values
    return _with_nodes(edit, channel, [cosines[i] for i in keep], [values[i] for i in keep])


def snap_to_fit(edit: CurveEdit, channel: int, index: int | None = None) -> CurveEdit:
    """Move one node, or all nodes, onto the fitted curve as far as the neighbours allow."""
    curve, fit = edit.curves[channel], edit.fits[channel]
    if index is not None:
        cosine = curve.cosines[index]
        return move_node(edit, channel, index, cosine, float(fit.at(cosine)))
    values = fit.at(np.array(curve.cosines))
    return _with_nodes(edit, channel, curve.cosines, values.tolist())


def smooth(edit: CurveEdit, channel: int) -> CurveEdit:
    """Move every inner node halfway to the line between its neighbours.

    Halfway keeps the order of any two neighbours: their target lines are strictly below the
    upper one and strictly above the lower one.
    """
    curve = edit.curves[channel]
    c, v = np.array(curve.cosines), np.array(curve.values)
    share = (c[1:-1] - c[:-2]) / (c[2:] - c[:-2])
    line = v[:-2] + share * (v[2:] - v[:-2])
    v[1:-1] = 0.5 * (v[1:-1] + line)
    return _with_nodes(edit, channel, curve.cosines, v.tolist())


def thin_nodes(edit: CurveEdit, channel: int, *, tolerance: float = TOLERANCE) -> CurveEdit:
    """Remove nodes that hardly change the curve, so that each node shapes a longer part.

    Parameters
    ----------
    edit, channel
        The state and the channel to change.
    tolerance : float, optional
        Largest change of the curve, as a share of its highest value.
    """
    curve = edit.curves[channel]
    c, v = np.array(curve.cosines), np.array(curve.values)
    kept = sorted({0, c.size // 3, 2 * c.size // 3, c.size - 1})
    while len(kept) < c.size:
        off = np.abs(PchipInterpolator(c[kept], v[kept])(c) - v)
        if off.max() <= tolerance * v[-1]:
            break
        kept = sorted({*kept, int(off.argmax())})
    return _with_nodes(edit, channel, c[kept].tolist(), v[kept].tolist())


def reset_channel(edit: CurveEdit, channel: int, start: CurveEdit) -> CurveEdit:
    """Reset a channel to its state in `start`, including its excluded points."""
    return _with_channel(
        edit,
        channel,
        start.curves[channel],
        start.fits[channel],
        start.coverage[channel],
        start.left_out[channel],
    )


def leave_out(
    edit: CurveEdit, channel: int, outline: Sequence[Sequence[float]], scatter: ReflectanceScatter
) -> CurveEdit:
    """Exclude the points inside an outline, and fit the channel's curve again.

    Parameters
    ----------
    edit, channel
        The state and the channel to change.
    outline : sequence of (cosine, value)
        Closed automatically.
    scatter : ReflectanceScatter
        All points.

    Raises
    ------
    InputError
        If the outline contains no point, or the remaining points cannot be fitted.
    """
    polygon = tuple((float(x), float(y)) for x, y in outline)
    outlines = (*edit.left_out[channel], polygon)
    before = left_out_points(edit.left_out[channel], scatter, channel)
    out = left_out_points(outlines, scatter, channel)
    if np.array_equal(before, out):
        raise InputError(
            tr("the outline contains no included point"),
            where=tr("Reflectance curve"),
            advice=tr("Draw it around the points that you want to exclude"),
        )
    fit = fit_channel(
        scatter.cosines[channel][~out], scatter.values[channel][~out], name=channel_name(channel)
    )
    curve = Curve(tuple(fit.cosines.tolist()), tuple(fit.values.tolist()))
    low, high = fit.coverage.tolist()
    return _with_channel(edit, channel, curve, curve, (low, high), outlines)


def left_out_points(
    outlines: Sequence[Outline], scatter: ReflectanceScatter, channel: int
) -> NDArray[np.bool_]:
    """Return which of a channel's points (N,) lie inside any of the outlines."""
    x, y = scatter.cosines[channel], scatter.values[channel]
    out = np.zeros(x.size, dtype=bool)
    for outline in outlines:
        out |= _inside(x, y, np.asarray(outline, np.float64))
    return out


def _inside(x: Array, y: Array, polygon: Array) -> NDArray[np.bool_]:
    """Return which points are inside a polygon, by the number of sides that their rays cross."""
    (left, low), (right, high) = polygon.min(axis=0), polygon.max(axis=0)
    near = np.flatnonzero((x >= left) & (x <= right) & (y >= low) & (y <= high))
    px, py = x[near], y[near]
    odd = np.zeros(near.size, dtype=bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = (y0 > py) != (y1 > py)
        odd ^= crosses & (px < x0 + (py - y0) * (x1 - x0) / (y1 - y0))
    result = np.zeros(x.size, dtype=bool)
    result[near[odd]] = True
    return result


def _value_gap(curve: Curve) -> float:
    """Return the least distance of two values, the same as in the fit."""
    return LEAST_STEP * curve.values[-1]


def _between(value: float, low: float, high: float, gap: float) -> float:
    """Return the value inside (low, high), a gap away from both ends if there is room for it."""
    gap = min(gap, 0.25 * (high - low))
    return float(min(max(value, low + gap), high - gap))


def _with_nodes(
    edit: CurveEdit, channel: int, cosines: Sequence[float], values: Sequence[float]
) -> CurveEdit:
    curves = list(edit.curves)
    curves[channel] = Curve(tuple(cosines), tuple(values))
    return replace(edit, curves=_three(curves))


def _with_channel(
    edit: CurveEdit,
    channel: int,
    curve: Curve,
    fit: Curve,
    coverage: tuple[float, float],
    outlines: tuple[Outline, ...],
) -> CurveEdit:
    curves, fits = list(edit.curves), list(edit.fits)
    ranges, left_out = list(edit.coverage), list(edit.left_out)
    curves[channel], fits[channel] = curve, fit
    ranges[channel], left_out[channel] = coverage, outlines
    return CurveEdit(_three(curves), _three(fits), _three(ranges), _three(left_out))


def _three(items: Sequence[T]) -> tuple[T, T, T]:
    first, second, third = items
    return first, second, third


def with_curves(edit: CurveEdit, curves: Mapping[int, Curve]) -> CurveEdit:
    """Return an edit with the curves of some channels replaced, such as stored ones."""
    return replace(edit, curves=_three([curves.get(k, edit.curves[k]) for k in range(3)]))
