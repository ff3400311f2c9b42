"""What the planned reconstruction reads of a calibration, made ready once for each sensor."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.reconstruction.full import LEAST_BASE, filled_inside
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.near_light import dark_brightness
from gelpolight_core.reflectance.membrane import CURVE_NODES, Membrane
from gelpolight_core.response.curve import CameraResponse

Map = NDArray[np.float32]
Triple = tuple[float, float, float]
DEGREE = 7
# The curve of the diffuse share is followed to this share of its top, 0.06 degrees of slope.
CURVE_ERROR = 1e-3
# Light from the surroundings that is weaker than this changes no ratio by more.
LEAST_BOUNCE = 1e-4
LEVELS = {np.dtype(np.uint8): 256, np.dtype(np.uint16): 65536}


@dataclass(frozen=True, slots=True)
class LiveScale:
    """One scale of the solve.

    Attributes
    ----------
    factor : int
        Nodes of the calibration's grid in one of its nodes, along an axis.
    shape : tuple of int
        (rows, columns).
    origin_mm : tuple of float
        (x, y) of the first node.
    pitch_mm : float
        Distance between nodes.
    static : (12, rows, columns) float32
        The lights' flat brightness over their near-light gain, times z / r^3 (3); noise of press
        over background (3); drift of the rays (2) and its derivatives by x and y (4).
    kind : (rows, columns) uint8
        2 usable, 1 inside but not usable, 0 outside.
    usable_nodes : int
        How many are.
    """

    factor: int
    shape: tuple[int, int]
    origin_mm: tuple[float, float]
    pitch_mm: float
    static: Map
    kind: NDArray[np.uint8]
    usable_nodes: int


@dataclass(frozen=True, slots=True)
class LiveMembrane:
    """The membrane and the lights as plain numbers in single precision.

    Attributes
    ----------
    leds : tuple of 3 tuples of 3
        Positions, sensor frame, mm.
    dark : tuple of 3
        Brightness below which a channel is dark.
    curves : tuple of 3 tuples of 8
        Polynomials of the diffuse share by the cosine, constant first.
    curve_error : float
        Largest distance of a polynomial from its curve, as a share of the curve's top.
    gloss : tuple of 2, or None
        Share and squared roughness of the glossy lobe.
    bounce : float or None
        Share of the light from the surroundings.
    """

    leds: tuple[Triple, Triple, Triple]
    dark: Triple
    curves: tuple[tuple[float, ...], ...]
    curve_error: float
    gloss: tuple[float, float] | None
    bounce: float | None


@dataclass(frozen=True, slots=True)
class LiveMaps:
    """All that does not change from frame to frame.

    Attributes
    ----------
    half, quarter : LiveScale
        The scales that are solved.
    u_px, v_px : (rows, columns) float32
        Raw pixel of each node at half scale.
    gain : (3, rows, columns) float32
        1 / background at half scale.
    flags : (rows, columns) uint8
        Of the whole grid, without a press.
    membrane : LiveMembrane
        Its response.
    """

    half: LiveScale
    quarter: LiveScale
    u_px: Map
    v_px: Map
    gain: Map
    flags: NDArray[np.uint8]
    membrane: LiveMembrane


def live_maps(calibration: Calibration, full: FullModel) -> LiveMaps:
    """Make a sensor's maps ready."""
    table = calibration.table
    usable = table.valid & (full.background > LEAST_BASE).all(axis=2)
    usable &= (calibration.factors > 0.0).all(axis=2)
    inside = filled_inside(usable)
    base = np.maximum(full.background, LEAST_BASE)
    half = _scale(calibration, full, usable, inside, base, 2)
    return LiveMaps(
        half,
        _scale(calibration, full, usable, inside, base, 4),
        _average(table.u_px, 2),
        _average(table.v_px, 2),
        _planes(1.0 / _average(base, 2)),
        np.where(usable, 0, int(Flag.OUTSIDE)).astype(np.uint8),
        live_membrane(full),
    )


def live_membrane(full: FullModel) -> LiveMembrane:
    """Return the membrane as the compiled solve wants it."""
    membrane = full.membrane
    curves, error = _polynomials(membrane)
    leds = [_triple(led) for led in full.led_positions_mm]
    glossy = membrane.gloss > 0.0
    return LiveMembrane(
        (leds[0], leds[1], leds[2]),
        _triple(dark_brightness(membrane)),
        curves,
        error,
        (_single(membrane.gloss), _single(membrane.roughness**2)) if glossy else None,
        _single(membrane.bounce) if membrane.bounce > LEAST_BOUNCE else None,
    )


def light_levels(response: CameraResponse | None, dtype: np.dtype[Any]) -> Map:
    """Return the linear light (3, levels) of every number that a camera of this depth gives."""
    levels = LEVELS[dtype]
    numbers = np.arange(levels).astype(dtype)
    if response is None:
        return np.tile((numbers / np.float32(levels - 1)).astype(np.float32), (3, 1))
    light = response.linearise(np.repeat(numbers[:, None, None], 3, axis=2))
    return np.ascontiguousarray(light[:, 0].T, np.float32)


def _polynomials(membrane: Membrane) -> tuple[tuple[tuple[float, ...], ...], float]:
    """Return the diffuse curves, over pi, as polynomials, and how far they are off."""
    cosines = np.linspace(0.0, 1.0, CURVE_NODES)[1:]
    wanted = membrane.diffuse_share(np.tile(cosines[:, None], (1, 3)))
    curves, error = [], 0.0
    for k in range(3):
        fitted = np.polynomial.Polynomial.fit(cosines, wanted[:, k], DEGREE)
        error = max(
            error,
            float(np.abs(fitted(cosines) / wanted[-1, k] - wanted[:, k] / wanted[-1, k]).max()),
        )
        share = np.asarray(fitted.convert(domain=(-1, 1)).coef, np.float64)
        share *= (1.0 - membrane.gloss) / pi
        curves.append(tuple(_single(v) for v in np.pad(share, (0, DEGREE + 1 - len(share)))))
    return tuple(curves), error


def _scale(
    calibration: Calibration,
    full: FullModel,
    usable: NDArray[np.bool_],
    inside: NDArray[np.bool_],
    base: Map,
    factor: int,
) -> LiveScale:
    grid = calibration.table.grid
    x, y = _middle(grid.x_mm, factor), _middle(grid.y_mm, factor)
    pitch = grid.pitch_mm * factor
    all_usable = _average(usable.astype(np.float32), factor) > 0.99
    mostly_inside = _average(inside.astype(np.float32), factor) > 0.5
    drift = _whole(_planes(_average(calibration.table.drift, factor)).astype(np.float64), x, y)
    # Averaging a block leaves the noise of one node over the block's width.
    noise = calibration.noise / np.sqrt(2.0) / factor
    static = static_maps(full, x, y, drift, _planes(noise / _average(base, factor)))
    return LiveScale(
        factor,
        (y.size, x.size),
        (float(x[0]), float(y[0])),
        pitch,
        static,
        np.where(all_usable, 2, mostly_inside).astype(np.uint8),
        int(np.count_nonzero(all_usable)),
    )


def _whole(
    drift: NDArray[np.float64], x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the drift with what no ray tells filled in by a plane through the rest."""
    known = np.isfinite(drift).all(axis=0)
    if known.all() or not known.any():
        return np.nan_to_num(drift)
    x, y = np.meshgrid(x_mm, y_mm)
    terms = np.stack([x, y, np.ones_like(x)], axis=-1)
    plane, *_ = np.linalg.lstsq(terms[known], drift[:, known].T, rcond=None)
    return np.asarray(np.where(known, drift, np.moveaxis(terms @ plane, -1, 0)))


def static_maps(
    full: FullModel,
    x_mm: NDArray[np.float64],
    y_mm: NDArray[np.float64],
    drift: NDArray[np.float64],
    sigma: Map,
) -> Map:
    """Return `LiveScale.static` from the rays' drift (2, ...) and the noise (3, ...)."""
    static = np.empty((12, y_mm.size, x_mm.size), np.float32)
    static[:3] = _flat_brightness(full, x_mm, y_mm, drift)
    static[3:6] = sigma
    static[6:8] = drift
    for place, axis in ((8, 1), (10, 0)):
        for k in range(2):
            static[place + k] = np.gradient(drift[k], x_mm[1] - x_mm[0], axis=axis)
    return static


def _flat_brightness(
    full: FullModel, x: NDArray[np.float64], y: NDArray[np.float64], drift: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (3, rows, columns): flat brightness times z / r^3 of each light."""
    rows, columns = y.size, x.size
    view = np.stack([*drift, np.full((rows, columns), -1.0)], axis=-1).reshape(-1, 3)
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    flat = np.tile([0.0, 0.0, -1.0], (rows * columns, 1))
    points = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], axis=-1).reshape(-1, 3)
    to_led = full.led_positions_mm[None] - points[:, None]
    distance = np.linalg.norm(to_led, axis=-1)
    response = full.membrane.response(to_led / distance[..., None], flat, view)
    strength = response * to_led[..., 2] / distance**3
    return np.asarray(strength.T.reshape(3, rows, columns))


def _average(values: NDArray[np.floating], factor: int) -> Map:
    """Average over blocks of nodes."""
    rows, columns = (n // factor for n in values.shape[:2])
    whole = np.ascontiguousarray(values[: rows * factor, : columns * factor], np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))


def _middle(axis_mm: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    count = axis_mm.size // factor
    return np.asarray(axis_mm[: count * factor].reshape(count, factor).mean(axis=1))


def _planes(values: NDArray[np.floating]) -> Map:
    """Return (rows, columns, k) as (k, rows, columns)."""
    return np.ascontiguousarray(np.moveaxis(values, -1, 0), np.float32)


def _single(value: float) -> float:
    """Return a number that the compiled code takes as single precision."""
    return np.float32(value)  # type: ignore[return-value]


def _triple(values: NDArray[np.floating]) -> Triple:
    return (_single(values[0]), _single(values[1]), _single(values[2]))
