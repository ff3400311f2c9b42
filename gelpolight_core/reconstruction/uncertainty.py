"""How far noise and what the model does not explain move slopes and depth of the full model.

Slopes: each channel is moved up and down by its noise and the normals are solved again, so that
conditioning, missing channels and weights all count as they did in the answer. Depth: random fields
of slope errors are integrated with the answer's own weights at quarter scale. Noise is white;
each octave of its wavelengths adds alike to the depth's variance, and of the two octaves that
quarter scale leaves out, the average of the even parts has taken most. Repeats of a picture scatter
by that. What the ball presses leave unexplained errs over lengths like the drape's and only where
the membrane is disturbed; it is the same in every repeat and another in every press. What the
calibration adds is common to all presses and stands with it (:class:`ScaleSd`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reconstruction.near_light import RaySlopes, ShadedField, solve_near_light
from gelpolight_core.reconstruction.placement import resample
from gelpolight_core.reconstruction.weighted import integrate_weighted
from gelpolight_core.reflectance.membrane import Membrane

Map = NDArray[np.float32]
SCALE = 4
# The standard deviation of 64 examples is known to 1 / sqrt(128), a twelfth of itself.
EXAMPLES = 64
# What the model leaves open is known less well anyhow.
MODEL_EXAMPLES = 16
# Press over background departs from 1 by about this where balls are pressed; there the joint
# refinement found its misfit. Where the membrane is less disturbed, less can be wrong.
DEPARTURE = 0.3
# An example needs to be right to a few percent only.
TOLERANCE = 0.03


@dataclass(frozen=True, slots=True)
class SlopeNoise:
    """What the noise of each channel does to the slopes.

    Attributes
    ----------
    moved_x, moved_y : (3, rows, columns) float32
        Change of the slopes along the rays by one standard deviation of each channel's noise.
    moved : (3, rows, columns) float32
        Size of the change of the surface's slopes, the root mean square of x and y.
    """

    moved_x: Map
    moved_y: Map
    moved: Map


@dataclass(frozen=True, slots=True)
class DepthNoise:
    """How far slopes and depth may be off, on the metric grid.

    Attributes
    ----------
    slope_sd, depth_sd_mm : (rows, columns) float32
        Standard deviations from the noise of a single picture.
    slope_model_sd, depth_model_sd_mm : (rows, columns) float32
        Standard deviations from what the model does not explain of a press.
    examples_mm : (examples, rows / 4, columns / 4) float32
        Errors of the depth that this noise could as well have made; each is one whole map, so that
        what is computed from a depth map can be given its own standard deviation.
    """

    slope_sd: Map
    depth_sd_mm: Map
    slope_model_sd: Map
    depth_model_sd_mm: Map
    examples_mm: Map


def slope_noise(
    field: ShadedField,
    depth_mm: Map,
    ratio_sd: Map,
    led_positions_mm: NDArray[np.float64],
    membrane: Membrane,
    *,
    workers: int = 1,
) -> SlopeNoise:
    """Move each channel by its noise, and solve the normals again.

    Parameters
    ----------
    field, depth_mm, led_positions_mm, membrane, workers
        As for :func:`~gelpolight_core.reconstruction.near_light.solve_near_light`.
    ratio_sd : (rows, columns, 3) float32
        Standard deviation of press over background, > 0.
    """
    moved_x, moved_y, moved = [], [], []
    for k in range(3):
        change = np.zeros_like(ratio_sd)
        change[..., k] = ratio_sd[..., k]
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
        moved.append(np.sqrt(0.125 * ((slopes[0] - slopes[1]) ** 2).sum(axis=-1)))
    return SlopeNoise(np.stack(moved_x), np.stack(moved_y), np.stack(moved))


def depth_examples(
    noise: SlopeNoise,
    times: Map,
    weight: Map,
    hold: Map | None,
    *,
    pitch_mm: float,
    reach_mm: float = 0.0,
    examples: int = EXAMPLES,
    workers: int = 1,
) -> Map:
    """Integrate examples of slope errors at quarter scale.

    Parameters
    ----------
    noise : SlopeNoise
        At full scale.
    times : (3, rows, columns) or (rows, columns) float32
        How many standard deviations of `noise` an average over 4 x 4 nodes errs by.
    weight, hold
        Those of the answer's own integration.
    pitch_mm : float
        Distance between nodes at full scale.
    reach_mm : float, optional
        Over which errors hang together; 0: they are white.
    examples, workers : int, optional
        How many, and threads of the transforms.

    Returns
    -------
    (examples, rows / 4, columns / 4) float32
        Along the rays.
    """
    moved_x, moved_y = (
        np.stack([quarter(m) for m in part * times]) for part in (noise.moved_x, noise.moved_y)
    )
    firm, held = quarter(weight), None if hold is None else quarter(hold)
    random = np.random.default_rng(0)
    sigma = reach_mm / (SCALE * pitch_mm * np.sqrt(2.0))
    found = []
    for _ in range(examples):
        drawn = random.standard_normal(moved_x.shape, dtype=np.float32)
        if sigma > 0.0:
            drawn = np.stack([cv2.GaussianBlur(d, (0, 0), sigma) for d in drawn])
            drawn /= drawn.std()
        solved = integrate_weighted(
            (moved_x * drawn).sum(axis=0),
            (moved_y * drawn).sum(axis=0),
            firm,
            pitch_mm=SCALE * pitch_mm,
            hold=held,
            tolerance=TOLERANCE,
            workers=workers,
        )
        found.append(solved.depth_mm)
    return np.stack(found)


def model_times(ratio: Map, ratio_sd: Map, misfit: float) -> Map:
    """Return the model's own error in units of the noise, (3, rows, columns).

    Parameters
    ----------
    ratio, ratio_sd : (rows, columns, 3) float32
        Press over background and its noise.
    misfit : float
        What the joint refinement left of it on the ball presses.
    """
    disturbed = np.minimum(np.abs(ratio - 1.0) / DEPARTURE, 1.0)
    return np.moveaxis(np.asarray(misfit * disturbed / ratio_sd, np.float32), -1, 0)


def place_examples(
    examples_mm: Map, slopes: RaySlopes, drift: Map, column: Map, row: Map
) -> tuple[Map, Map]:
    """Bring examples from the rays to true positions.

    Parameters
    ----------
    examples_mm : (examples, rows / 4, columns / 4) float32
        Along the rays.
    slopes : RaySlopes
        The answer's.
    drift : (rows, columns, 2) float32
        Sideways move of the rays per mm of depth.
    column, row : (rows, columns) float32
        From :func:`~gelpolight_core.reconstruction.placement.place_on_grid`.

    Returns
    -------
    examples_mm : (examples, rows / 4, columns / 4) float32
        On the metric grid.
    sd_mm : (rows, columns) float32
        Their standard deviation.
    """
    # A ray's point slides along the surface as it goes deeper: D(P0 + d w) = d.
    along = slopes.normals[..., 2] - (slopes.normals[..., :2] * drift).sum(axis=-1)
    stretch = quarter(np.abs(along / slopes.normals[..., 2]))
    first = np.float32(0.5 * (SCALE - 1))
    at_column, at_row = ((quarter(c) - first) / np.float32(SCALE) for c in (column, row))
    placed = np.stack([resample(e * stretch, at_column, at_row) for e in examples_mm])
    rows, columns = column.shape
    variance = cv2.resize(np.mean(placed**2, axis=0), (columns, rows))
    return placed, np.asarray(np.sqrt(np.maximum(variance, 0.0)), np.float32)


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
