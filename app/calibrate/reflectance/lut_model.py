"""The curves of the editor: immutable nodes, and functions that return the next curve.

Every curve stays strictly increasing from no light to full light, so that it can be inverted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from gelpolight_core.base.arrays import Float64Array, PointXY
from gelpolight_core.light.reflectance_table import LEAST_STEP, ReflectanceTable

LEAST_GAP = 1e-3
"""Nodes closer in cosine than this cannot be separated with the pointer."""
TOLERANCE = 2e-3
"""Largest change of a curve by removing nodes, as a share of its highest value."""


@dataclass(frozen=True, slots=True)
class ReflectanceCurve:
    """Nodes of one channel. Two curves are equal if all their nodes are.

    Attributes
    ----------
    points : tuple of (cosine, value)
        Both increase strictly; cosines from 0 to 1, values from 0 or above.
    """

    points: tuple[PointXY, ...]

    @property
    def cosines(self) -> tuple[float, ...]:
        """Cosines of the nodes."""
        return tuple(cosine for cosine, _ in self.points)

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the nodes."""
        return tuple(value for _, value in self.points)

    def at(self, cosine: Float64Array | float) -> Float64Array:
        """Return the values at cosines between 0 and 1."""
        return np.asarray(PchipInterpolator(self.cosines, self.values)(cosine))


CurveSet = tuple[ReflectanceCurve, ...]
"""The curves of red, green and blue."""


def _curve(cosines: Iterable[float], values: Iterable[float]) -> ReflectanceCurve:
    return ReflectanceCurve(
        tuple((float(c), float(v)) for c, v in zip(cosines, values, strict=True))
    )


def fitted_curves(table: ReflectanceTable) -> CurveSet:
    """Return the curves of a calibration's table, with as few nodes as draw them."""
    return tuple(map(thinned, table.cosines, table.values))


def with_nodes(curves: CurveSet, nodes: Mapping[int, tuple[PointXY, ...]]) -> CurveSet:
    """Return curves with the stored nodes of some channels."""
    return tuple(
        ReflectanceCurve(nodes[k]) if k in nodes else curve for k, curve in enumerate(curves)
    )


def with_curve(curves: CurveSet, channel: int, curve: ReflectanceCurve) -> CurveSet:
    """Return curves with another curve of one channel."""
    return with_nodes(curves, {channel: curve.points})


def edited_nodes(curves: CurveSet, fitted: CurveSet) -> dict[int, tuple[PointXY, ...]]:
    """Return the nodes of the curves that differ from the fit, by channel."""
    pairs = enumerate(zip(curves, fitted, strict=True))
    return {k: curve.points for k, (curve, fit) in pairs if curve != fit}


def move_node(curve: ReflectanceCurve, index: int, cosine: float, value: float) -> ReflectanceCurve:
    """Move a node as far as its neighbours allow. The end nodes keep their cosine."""
    cosines, values = list(curve.cosines), list(curve.values)
    last, gap = len(cosines) - 1, LEAST_STEP * curve.values[-1]
    if 0 < index < last:
        cosines[index] = _between(cosine, cosines[index - 1], cosines[index + 1], LEAST_GAP)
    low = values[index - 1] if index > 0 else -gap
    high = values[index + 1] if index < last else np.inf
    values[index] = max(_between(value, low, high, gap), 0.0)
    return _curve(cosines, values)


def thinned(c: Float64Array, v: Float64Array) -> ReflectanceCurve:
    """Return a curve without the nodes that hardly change it: each one shapes a longer part."""
    nodes = sorted({0, c.size // 3, 2 * c.size // 3, c.size - 1})
    while len(nodes) < c.size:
        deviation = np.abs(PchipInterpolator(c[nodes], v[nodes])(c) - v)
        if deviation.max() <= TOLERANCE * v[-1]:
            break
        nodes = sorted({*nodes, int(deviation.argmax())})
    return _curve(c[nodes], v[nodes])


def _between(value: float, low: float, high: float, gap: float) -> float:
    """Return the value inside (low, high), a gap away from both ends if there is room for it."""
    gap = min(gap, 0.25 * (high - low))
    return float(min(max(value, low + gap), high - gap))
