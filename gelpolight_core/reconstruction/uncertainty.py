"""How far a picture's noise moves slopes and depth of the full model.

Slopes: each raw channel is moved up and down by its noise and the normals are solved again, so that
conditioning, missing channels and weights all count as they did in the answer. Depth: random fields
of that noise are integrated with the answer's own weights at quarter scale. Integration is linear
and noise of slopes is white, so that each octave of wavelengths adds alike to the depth's
variance; of the two octaves that quarter scale leaves out the average of the even parts has taken
most. What is stated here is what repeats of the picture scatter by; what the calibration adds is
common to all repeats and stands with the calibration (:class:`ScaleSd`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reconstruction.near_light import RaySlopes, ShadedField, solve_near_light
from gelpolight_core.reconstruction.weighted import integrate_weighted
from gelpolight_core.reflectance.membrane import Membrane

Map = NDArray[np.float32]
SCALE = 4
# The standard deviation of 32 examples is known to 1 / sqrt(64), an eighth of itself.
EXAMPLES = 32
# An example needs to be right to a few percent only.
TOLERANCE = 0.03


@dataclass(frozen=True, slots=True)
class SlopeNoise:
    """What the noise of each raw channel does to the slopes.

    Attributes
    ----------
    moved_x, moved_y : (3, rows, columns) float32
        Change of the slopes along the rays by one standard deviation of each channel's noise.
    slope_sd : (rows, columns) float32
        Standard deviation of the surface's slopes, the root mean square of x and y.
    """

    moved_x: Map
    moved_y: Map
    slope_sd: Map


@dataclass(frozen=True, slots=True)
class DepthNoise:
    """What a picture's noise does to the depth, on the metric grid.

    Attributes
    ----------
    slope_sd, depth_sd_mm : (rows, columns) float32
        Standard deviations from the noise of a single picture.
    examples_mm : (examples, rows / 4, columns / 4) float32
        Errors of the depth that this noise could as well have made; each is one whole map, so that
        what is computed from a depth map can be given its own standard deviation.
    """

    slope_sd: Map
    depth_sd_mm: Map
    examples_mm: Map


def slope_noise(
    field: ShadedField,
    depth_mm: Map,
    ratio_noise: Map,
    led_positions_mm: NDArray[np.float64],
    membrane: Membrane,
    *,
    workers: int = 1,
) -> SlopeNoise:
    """Move each raw channel by its noise, and solve the normals again.

    Parameters
    ----------
    field, depth_mm, led_positions_mm, membrane, workers
        As for :func:`~gelpolight_core.reconstruction.near_light.solve_near_light`.
    ratio_noise : (3, rows, columns, 3) float32
        Change of press over background by one standard deviation of each raw channel.
    """
    moved_x, moved_y, variance = [], [], np.zeros(depth_mm.shape, np.float32)
    for change in ratio_noise:
        high, low = (
            solve_near_light(
                replace(field, ratio=np.asarray(field.ratio + sign * change, np.float32)),
                depth_mm,
                led_positions_mm,
                membrane,
                workers=workers,
            )
            for sign in (1.0, -1.0)
        )
        moved_x.append(0.5 * (high.slope_x - low.slope_x))
        moved_y.append(0.5 * (high.slope_y - low.slope_y))
        slopes = [s.normals[..., :2] / s.normals[..., 2:] for s in (high, low)]
        variance += 0.5 * (0.25 * (slopes[0] - slopes[1]) ** 2).sum(axis=-1)
    return SlopeNoise(np.stack(moved_x), np.stack(moved_y), np.sqrt(variance))


def depth_examples(
    noise: SlopeNoise,
    noise_left: Map,
    pixels_per_node: Map,
    weight: Map,
    hold: Map | None,
    *,
    pitch_mm: float,
    examples: int = EXAMPLES,
    workers: int = 1,
) -> Map:
    """Integrate examples of the slopes' noise at quarter scale.

    Parameters
    ----------
    noise : SlopeNoise
        At full scale.
    noise_left : (rows, columns) float32
        Noise of a node as a share of a raw pixel's; `noise` is for that much of it.
    pixels_per_node : (rows, columns) float32
        Raw pixels in the area of one node.
    weight, hold
        Those of the answer's own integration.
    pitch_mm : float
        Distance between nodes at full scale.
    examples, workers : int, optional
        How many, and threads of the transforms.

    Returns
    -------
    (examples, rows / 4, columns / 4) float32
        Along the rays.
    """
    # Averages of a block have the noise of all raw pixels in it, correlated by no filter.
    block = 1.0 / (SCALE * np.sqrt(pixels_per_node) * noise_left)
    moved = [
        np.stack([quarter(np.asarray(m * block, np.float32)) for m in part])
        for part in (noise.moved_x, noise.moved_y)
    ]
    firm, held = quarter(weight), None if hold is None else quarter(hold)
    random = np.random.default_rng(0)
    found = []
    for _ in range(examples):
        drawn = random.standard_normal(moved[0].shape, dtype=np.float32)
        solved = integrate_weighted(
            (moved[0] * drawn).sum(axis=0),
            (moved[1] * drawn).sum(axis=0),
            firm,
            pitch_mm=SCALE * pitch_mm,
            hold=held,
            tolerance=TOLERANCE,
            workers=workers,
        )
        found.append(solved.depth_mm)
    return np.stack(found)


def place_noise(
    noise: SlopeNoise, examples_mm: Map, slopes: RaySlopes, drift: Map, column: Map, row: Map
) -> DepthNoise:
    """Bring the noise from the rays to true positions.

    Parameters
    ----------
    noise, examples_mm
        Along the rays.
    slopes : RaySlopes
        The answer's.
    drift : (rows, columns, 2) float32
        Sideways move of the rays per mm of depth.
    column, row : (rows, columns) float32
        From :func:`~gelpolight_core.reconstruction.placement.place_on_grid`.
    """
    # A ray's point slides along the surface as it goes deeper: D(P0 + d w) = d.
    along = slopes.normals[..., 2] - (slopes.normals[..., :2] * drift).sum(axis=-1)
    stretch = quarter(np.abs(along / slopes.normals[..., 2]))
    first = np.float32(0.5 * (SCALE - 1))
    at_column, at_row = ((quarter(c) - first) / np.float32(SCALE) for c in (column, row))
    placed = np.stack([_remap(e * stretch, at_column, at_row) for e in examples_mm])
    rows, columns = column.shape
    variance = cv2.resize(np.mean(placed**2, axis=0), (columns, rows))
    return DepthNoise(
        _remap(noise.slope_sd, column, row), np.sqrt(np.maximum(variance, 0.0)), placed
    )


def pixels_per_node(table: ResamplingTable) -> Map:
    """Return how many raw pixels lie in the area of one node, (rows, columns) float32."""
    u_row, u_column = np.gradient(table.u_px)
    v_row, v_column = np.gradient(table.v_px)
    count = np.abs(u_column * v_row - u_row * v_column)
    # At the edge of what is seen the differences mean nothing.
    return np.asarray(np.where(table.valid, np.clip(count, 0.1, 10.0), 1.0), np.float32)


def quarter(values: Map) -> Map:
    """Return averages over blocks of 4 x 4 nodes."""
    rows, columns = (n // SCALE for n in values.shape[:2])
    whole = np.ascontiguousarray(values[: rows * SCALE, : columns * SCALE], np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))


def _remap(values: Map, column: Map, row: Map) -> Map:
    return np.asarray(
        cv2.remap(values, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )
