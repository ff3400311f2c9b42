"""The model of the curve editor: an immutable state, and functions that return the next state.

A state holds the nodes of the three channels, the fitted curves, and the outlines of the excluded
points. No function changes a state, so that undo only has to show an older one. Every curve stays
strictly increasing from no light to full light, so that it can be inverted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import channel_name
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.reflectance.table import LEAST_STEP, ReflectanceTable, fit_channel
from gelpolight_core.translation import tr

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
class Channel:
    """One channel of a state of the editor.

    Attributes
    ----------
    curve : Curve
        The edited curve.
    fit : Curve
        Fit to the points that are not excluded.
    coverage : (low, high)
        Range of cosines that these points cover; outside of it the curve is extrapolated.
    left_out : tuple of outlines
        Points inside any of these outlines (cosine, value) are excluded.
    """

    curve: Curve
    fit: Curve
    coverage: tuple[float, float]
    left_out: tuple[Outline, ...] = ()


CurveEdit = tuple[Channel, Channel, Channel]
"""One state of the editor: red, green and blue."""


def start_edit(table: ReflectanceTable) -> CurveEdit:
    """Return the initial state of the editor for a calibration's table."""
    channels = []
    for cosines, values, (low, high) in zip(
        table.cosines, table.values, table.coverage.tolist(), strict=True
    ):
        curve = Curve(tuple(cosines.tolist()), tuple(values.tolist()))
        channels.append(Channel(curve, curve, (low, high)))
    red, green, blue = channels
    return red, green, blue


def table_of(edit: CurveEdit) -> ReflectanceTable:
    """Return the edited curves as a reflectance table."""
    red, green, blue = (
        (np.array(channel.curve.cosines), np.array(channel.curve.values)) for channel in edit
    )
    coverage = np.array([channel.coverage for channel in edit])
    return ReflectanceTable((red[0], green[0], blue[0]), (red[1], green[1], blue[1]), coverage)


def move_node(edit: CurveEdit, channel: int, index: int, cosine: float, value: float) -> CurveEdit:
    """Move a node as far as its neighbours allow; the end nodes keep their cosine."""
    curve = edit[channel].curve
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
    curve = edit[channel].curve
    cosines, values = list(curve.cosines), list(curve.values)
    index = int(np.searchsorted(cosines, cosine))
    inside = 0.0 < cosine < 1.0
    if not inside or min(cosine - cosines[index - 1], cosines[index] - cosine) < LEAST_GAP:
        raise InputError(
            tr("there is no room for a node at cosine {cosine:.3f}").format(cosine=cosine),
            where=tr("Reflectance curve"),
            advice=Remedy.MOVE_NODES,
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
    curve = edit[channel].curve
    if index in (0, len(curve.cosines) - 1):
        raise InputError(
            tr("the end nodes of the curve cannot be removed"),
            where=tr("Reflectance curve"),
            advice=Remedy.MOVE_NODES,
        )
    if len(curve.cosines) <= LEAST_NODES:
        raise InputError(
            tr("a curve needs at least {n} nodes").format(n=LEAST_NODES),
            where=tr("Reflectance curve"),
            advice=Remedy.MOVE_NODES,
        )
    keep = [i for i in range(len(curve.cosines)) if i != index]
    cosines, values = curve.cosines, curve.values
    return _with_nodes(edit, channel, [cosines[i] for i in keep], [values[i] for i in keep])


def snap_to_fit(edit: CurveEdit, channel: int, index: int | None = None) -> CurveEdit:
    """Move one node, or all nodes, onto the fitted curve as far as the neighbours allow."""
    curve, fit = edit[channel].curve, edit[channel].fit
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
    curve = edit[channel].curve
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
    curve = edit[channel].curve
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
    return _with(edit, channel, start[channel])


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
    outlines = (*edit[channel].left_out, polygon)
    before = left_out_points(edit[channel].left_out, scatter, channel)
    out = left_out_points(outlines, scatter, channel)
    if np.array_equal(before, out):
        raise InputError(
            tr("the outline contains no included point"),
            where=tr("Reflectance curve"),
            advice=Remedy.DRAW_AGAIN,
        )
    fit = fit_channel(
        scatter.cosines[channel][~out], scatter.values[channel][~out], name=channel_name(channel)
    )
    curve = Curve(tuple(fit.cosines.tolist()), tuple(fit.values.tolist()))
    low, high = fit.coverage.tolist()
    return _with(edit, channel, Channel(curve, curve, (low, high), outlines))


def left_out_points(
    outlines: Sequence[Outline], scatter: ReflectanceScatter, channel: int
) -> NDArray[np.bool_]:
    """Return which of a channel's points (N,) lie inside any of the outlines."""
    points = np.stack([scatter.cosines[channel], scatter.values[channel]], axis=-1)
    out = np.zeros(len(points), dtype=bool)
    for outline in outlines:
        out |= Path(outline).contains_points(points)
    return out


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
    curve = Curve(tuple(cosines), tuple(values))
    return _with(edit, channel, replace(edit[channel], curve=curve))


def _with(edit: CurveEdit, channel: int, changed: Channel) -> CurveEdit:
    red, green, blue = (changed if k == channel else edit[k] for k in range(3))
    return red, green, blue


def with_curves(edit: CurveEdit, curves: Mapping[int, Curve]) -> CurveEdit:
    """Return an edit with the curves of some channels replaced, such as stored ones."""
    for channel, curve in curves.items():
        edit = _with(edit, channel, replace(edit[channel], curve=curve))
    return edit
