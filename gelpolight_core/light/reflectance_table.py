"""The reflectance table: brightness of the membrane over the angle of light (Eq. 6, 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.robust import robust_sd

BIN_COUNT = 40
LEAST_IN_BIN = 30
LEAST_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class ReflectanceTable:
    """Reflectance curve G of each channel with its inverse R, as monotone nodes.

    Attributes
    ----------
    cosines : tuple of 3 (nodes,) arrays
        cos(theta), strictly increasing from 0 to 1.
    values : tuple of 3 (nodes,) arrays
        Processed pixel values I / (rho |L|) at those cosines, strictly increasing; the first is the
        stray light in a shadow.
    coverage : (3, 2)
        Lowest and highest cosine of the ball presses; beyond them, the table is extrapolated.
    """

    cosines: tuple[Float64Array, Float64Array, Float64Array]
    values: tuple[Float64Array, Float64Array, Float64Array]
    coverage: Float64Array

    def check(self) -> None:
        """Refuse columns that do not rise or do not fit together.

        Raises
        ------
        ValueError
            With the first fault.
        """
        for cosines, values in zip(self.cosines, self.values, strict=True):
            if cosines.ndim != 1 or cosines.size < 2 or cosines.shape != values.shape:
                raise ValueError("the columns of the reflectance table differ in length")
            if not ((np.diff(cosines) > 0.0).all() and (np.diff(values) > 0.0).all()):
                raise ValueError("the reflectance table is not monotone")
        if self.coverage.shape != (3, 2):
            raise ValueError("the coverage of the reflectance table is impossible")

    def response(self, channel: int, cosine: Float64Array) -> Float64Array:
        """Return G(cos theta) of one channel (Eq. 6), clipped to cosines 0..1.

        Parameters
        ----------
        channel : int
            0, 1, 2: red, green, blue.
        cosine : (...)
            Cosine of the angle between light and normal.
        """
        from scipy.interpolate import PchipInterpolator  # slow to import

        curve = PchipInterpolator(self.cosines[channel], self.values[channel])
        return np.asarray(curve(np.clip(cosine, 0.0, 1.0)))

    def cosine(self, channel: int, value: Float64Array) -> Float64Array:
        """Return R(I / (rho |L|)) of one channel (Eq. 7), clipped to cosines 0..1.

        Parameters
        ----------
        channel : int
            0, 1, 2: red, green, blue.
        value : (...)
            Processed pixel value I / (rho |L|).
        """
        from scipy.interpolate import PchipInterpolator  # slow to import

        nodes = self.values[channel]
        curve = PchipInterpolator(nodes, self.cosines[channel])
        return np.asarray(curve(np.clip(value, nodes[0], nodes[-1])))

    def lookup(self) -> tuple[Float32Array, Float32Array]:
        """Return R sampled evenly for the live path.

        Returns
        -------
        table : (3, N) float32
            Cosines at even steps of the processed value, from 0 to each channel's last node.
        scale : (3,) float32
            Factor from a processed value to its index in the table.
        """
        size = 2048  # steps as fine as those of an image of 11 bits
        table = np.stack(
            [self.cosine(k, np.linspace(0.0, self.values[k][-1], size)) for k in range(3)]
        )
        scale = np.array([(size - 1) / self.values[k][-1] for k in range(3)])
        return table.astype(np.float32), scale.astype(np.float32)


def cosine_table() -> ReflectanceTable:
    """Return the table of an ideal diffuse membrane: G(cos) = cos."""
    nodes = np.linspace(0.0, 1.0, 11)
    coverage = np.tile([0.0, 1.0], (3, 1))
    return ReflectanceTable((nodes, nodes, nodes), (nodes, nodes, nodes), coverage)


@dataclass(frozen=True, slots=True)
class ChannelFit:
    """One channel's curve with the scatter that it was fitted to.

    Attributes
    ----------
    cosines, values : (nodes,)
        The curve.
    coverage : (2,)
        Lowest and highest cosine with data.
    spread : float
        Robust relative scatter of the points about the curve.
    outlier_share : float
        Share of points beyond four spreads.
    """

    cosines: Float64Array
    values: Float64Array
    coverage: Float64Array
    spread: float
    outlier_share: float


def fit_channel(cosines: Float64Array, values: Float64Array, *, name: str) -> ChannelFit:
    """Fit one channel's monotone curve to a scatter of ball pixels.

    The cosine is known from the ball's shape, and the noise is in the image. Therefore the value is
    averaged at given cosine (by the median), made monotone and then inverted.

    Parameters
    ----------
    cosines : (N,)
        cos(theta) from the ball's normals.
    values : (N,)
        Processed pixel values I / (rho |L|).
    name : str
        The channel's name, for messages.

    Raises
    ------
    InputError
        If there are too few points, or they do not increase with the cosine.
    """
    from scipy.interpolate import PchipInterpolator  # slow to import
    from scipy.optimize import isotonic_regression

    valid = np.isfinite(cosines) & np.isfinite(values) & (cosines > 0.0) & (cosines <= 1.0)
    cosines, values = np.asarray(cosines)[valid], np.asarray(values)[valid]
    if cosines.size < 10 * LEAST_IN_BIN:
        raise _poor(name, "only {n} usable pixels in the {name} channel", n=cosines.size)
    low, high = np.quantile(cosines, [0.002, 0.998])
    edges = np.linspace(low, high, BIN_COUNT + 1)
    centre, medians, count = _bin(cosines, values, edges)
    if centre.size < 4:
        raise _poor(name, "the {name} channel shows only {n} angles of light", n=centre.size)
    monotone = np.asarray(isotonic_regression(medians, weights=np.sqrt(count)).x)
    if monotone[-1] < 1.05 * monotone[0]:
        raise _poor(
            name,
            "the {name} channel does not become brighter towards its LED ({n} bins)",
            n=centre.size,
        )
    node_cosines, node_values = _close_ends(centre, monotone)
    curve = PchipInterpolator(node_cosines, node_values)
    residual = values / np.maximum(curve(cosines), 1e-9) - 1.0
    sd = robust_sd(residual)
    outliers = float((np.abs(residual) > 4.0 * max(sd, 1e-6)).mean())
    return ChannelFit(
        node_cosines,
        node_values,
        np.array([centre[0], centre[-1]]),
        sd,
        outliers,
    )


def _poor(name: str, text: str, *, n: int) -> InputError:
    return InputError(text.format(name=name, n=n), "balls", Remedy.PRESS_BALLS)


def _bin(
    cosines: Float64Array, values: Float64Array, edges: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the mean cosine of each bin and the value there, sigma-clipped about a line."""
    bin_index = np.digitize(cosines, edges) - 1
    rows = []
    for i in range(edges.size - 1):
        in_bin = bin_index == i
        if in_bin.sum() < LEAST_IN_BIN:
            continue
        x, y = cosines[in_bin], values[in_bin]
        for _ in range(3):
            median = np.median(y)
            inlier_mask = np.abs(y - median) <= 3.0 * robust_sd(y - median) + 1e-12
            x, y = x[inlier_mask], y[inlier_mask]
        rows.append((x.mean(), y.mean(), y.size))
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _close_ends(cosines: Float64Array, values: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Extend the curve to no light and to full light, without flat steps.

    The value at cos = 0 is extrapolated from the low end, not set to zero: the rest is stray light
    and crosstalk, as in a shadow.
    """
    low = cosines <= cosines[0] + 0.2 * (cosines[-1] - cosines[0])
    first = values[0] - _slope(cosines[low], values[low]) * cosines[0]
    high = cosines >= cosines[-1] - 0.25 * (cosines[-1] - cosines[0])
    last = values[-1] + _slope(cosines[high], values[high]) * (1.0 - cosines[-1])
    node_cosines = np.concatenate([[0.0], cosines, [1.0]])
    node_values = np.concatenate([[max(first, 0.0)], values, [last]])
    if node_cosines[-1] - node_cosines[-2] < LEAST_STEP:
        node_cosines, node_values = node_cosines[:-1], node_values[:-1]
        node_cosines[-1] = 1.0
    ramp = LEAST_STEP * node_values[-1] * np.arange(node_values.size)
    return node_cosines, np.maximum.accumulate(node_values - ramp) + ramp


def _slope(cosines: Float64Array, values: Float64Array) -> float:
    """Return the slope of a line through the points, at least 0 (0 for less than two)."""
    return max(float(np.polyfit(cosines, values, 1)[0]), 0.0) if cosines.size > 1 else 0.0
