"""The full model: near light from coarse to fine, ray-true integration, true positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from gelpolight_core.calibration.ball_pixels import neighbourhood
from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.reconstruction.denoise import noise_left, quiet_even_parts
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.near_light import RaySlopes, ShadedField, solve_near_light
from gelpolight_core.reconstruction.near_light_kernel import UNSOLVED_WEIGHT
from gelpolight_core.reconstruction.picture_noise import picture_noise
from gelpolight_core.reconstruction.placement import place_on_grid, resample
from gelpolight_core.reconstruction.poisson import integrate_slopes
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.reconstruction.uncertainty import (
    MODEL_EXAMPLES,
    DepthNoise,
    depth_examples,
    model_times,
    pixels_per_node,
    place_examples,
    slope_noise,
)
from gelpolight_core.reconstruction.weighted import integrate_weighted

Map = NDArray[np.float32]
SATURATED = 0.995
LEAST_BASE = 0.01
# A share of the brightness below any camera's noise; zero would say nothing of conditioning.
LEAST_NOISE = 1e-5
COARSE = 4
# A round may not move the surface by more than this share of the LEDs' height: light that is
# frozen further off than that says next to nothing of the slopes there.
LONGEST_STEP = 0.2
# Rounds after a step was held back, and the share of such a step below which they have settled.
HELD_ROUNDS = 10
SETTLED = 0.05
RIM_MM = 0.5
RIM_CHANGE = 0.08
RIM_REACH_MM = 2.5
LET_GO = 1e-3


@dataclass(frozen=True, slots=True)
class FullDepth:
    """A reconstruction by the full model, at true positions on the metric grid.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        At the grid's own (x, y).
    normals : (rows, columns, 3) float32
        Unit normals, z < 0.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    changes_mm : tuple of float
        Largest change of the depth in each near-light round.
    rim : str
        ``held`` at depth 0, or ``free`` where a contact crosses it.
    stopped : str
        Why the rounds ended: ``done``; ``damped`` when steps were held back and the rounds settled
        all the same; ``grows`` when the last change was larger than the one before and the round
        was taken back; ``unsettled`` when damped rounds came to no end.
    noise : DepthNoise or None
        How far it may be off, where that was asked for.
    unsolved : float
        Share of the usable nodes that light does not decide: less than two lights, or turned away.
    """

    depth_mm: Map
    normals: Map
    flags: NDArray[np.uint8]
    changes_mm: tuple[float, ...]
    rim: str
    stopped: str
    noise: DepthNoise | None = None
    unsolved: float = 0.0


def reconstruct_full(
    rgb: Map,
    calibration: Calibration,
    full: FullModel,
    *,
    terms: Terms = ALL_TERMS,
    workers: int = 2,
    uncertainty: bool = False,
) -> FullDepth:
    """Reconstruct one picture by the full model.

    Parameters
    ----------
    rgb : (height, width, 3) float32
        Raw picture, linear light 0..1.
    calibration, full
        The sensor's.
    terms : Terms, optional
        What is reckoned with; by default everything.
    workers : int, optional
        Threads of the transforms.
    uncertainty : bool, optional
        Whether to find out how far it may be off; it takes several times as long.
    """
    field = shaded_field(rgb, calibration, full, terms=terms)
    pitch = calibration.table.grid.pitch_mm
    depth, (changes, stopped) = coarse_depth(field, full, pitch, workers, terms=terms)
    slopes, solved, rim = _round(field, depth, full, pitch, workers, terms)
    last = float(np.abs(solved - depth).max())
    moved = held_back(depth, solved, longest_step_mm(full))
    drift = field.drift if terms.true_positions else np.zeros_like(field.drift)
    placed = place_on_grid(moved, drift, field.x_mm, field.y_mm)
    result = _placed(slopes, moved, placed, (*changes, last), (rim, stopped))
    result = replace(result, unsolved=_unsolved_share(slopes, field))
    if not uncertainty:
        return result
    noise = _noise(rgb, calibration, full, field, depth, slopes, placed, workers)
    return replace(result, noise=noise)


def _unsolved_share(slopes: RaySlopes, field: ShadedField) -> float:
    """Return the share of nodes that light does not decide, from every second one."""
    thin = np.s_[::2, ::2]
    usable = field.usable[thin]
    unsolved = usable & (slopes.weight[thin] <= UNSOLVED_WEIGHT)
    return float(np.count_nonzero(unsolved)) / max(int(np.count_nonzero(usable)), 1)


def coarse_depth(
    field: ShadedField,
    full: FullModel,
    pitch_mm: float,
    workers: int,
    *,
    terms: Terms = ALL_TERMS,
) -> tuple[Map, tuple[tuple[float, ...], str]]:
    """Run the near-light rounds at quarter scale.

    Parameters
    ----------
    field : ShadedField
        At full scale.
    full : FullModel
        The sensor's.
    pitch_mm : float
        Distance between the field's nodes.
    workers : int
        Threads.
    terms : Terms, optional
        What is reckoned with.

    Returns
    -------
    depth_mm : (rows, columns) float32
        Brought back to the field's own scale.
    changes_mm, stopped
        As in :class:`FullDepth`.
    """
    coarse = coarsen(field)

    def solve(depth: Map) -> Map:
        return _round(coarse, depth, full, pitch_mm * COARSE, workers, terms)[1]

    depth, said = near_light_rounds(
        solve, coarse.usable.shape, longest_step_mm(full), terms.near_light_rounds
    )
    rows, columns = field.usable.shape
    whole = cv2.resize(depth, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return np.asarray(whole), said


def near_light_rounds(
    solve: Callable[[Map], Map],
    shape: tuple[int, ...],
    longest_mm: float,
    wanted: int,
    *,
    shallow_mm: float = 0.0,
) -> tuple[Map, tuple[tuple[float, ...], str]]:
    """Repeat a round until as many as wanted are done, and until they settle where held back.

    Parameters
    ----------
    solve : function of the present depth (rows, columns)
        One round.
    shape : tuple of int
        Of the depth, which starts at 0.
    longest_mm : float
        How far a round may move the surface.
    wanted : int
        Rounds.
    shallow_mm : float, optional
        One round is enough where it moves the surface by less.

    Returns
    -------
    depth_mm : (rows, columns) float32
    changes_mm, stopped
        As in :class:`FullDepth`.
    """
    depth = np.zeros(shape, np.float32)
    changes: list[float] = []
    stopped = "unsettled" if wanted else "done"
    for _ in range(HELD_ROUNDS if wanted else 0):
        solved = solve(depth)
        changes.append(float(np.abs(solved - depth).max()))
        if len(changes) > 1 and changes[-1] > changes[-2]:
            stopped = "grows"
            break
        depth = held_back(depth, solved, longest_mm)
        held = max(changes) > longest_mm
        enough = len(changes) >= wanted or changes[-1] < shallow_mm
        if enough and (not held or changes[-1] <= SETTLED * longest_mm):
            stopped = "damped" if held else "done"
            break
    return depth, (tuple(changes), stopped)


def longest_step_mm(full: FullModel) -> float:
    """Return how far one round may move the surface."""
    return LONGEST_STEP * float(np.abs(full.led_positions_mm[:, 2]).min())


def held_back(depth_mm: Map, solved_mm: Map, longest_mm: float) -> Map:
    """Return the solved depth, or as much of the way to it as its longest step may be."""
    step = solved_mm - depth_mm
    longest = float(np.abs(step).max())
    if longest <= longest_mm:
        return solved_mm
    return np.asarray(depth_mm + np.float32(longest_mm / longest) * step)


def as_linear(frame: NDArray[Any]) -> Map:
    """Return a frame as float32, 0..1, whatever it was."""
    scale = 1.0 if frame.dtype.kind == "f" else 1.0 / np.iinfo(frame.dtype).max
    return np.asarray(frame, np.float32) * np.float32(scale)


def _round(
    field: ShadedField,
    depth_mm: Map,
    full: FullModel,
    pitch_mm: float,
    workers: int,
    terms: Terms,
) -> tuple[RaySlopes, Map, str]:
    """One near-light round: normals at the present depth, their depth, and how the rim was held."""
    slopes = solve_near_light(
        field,
        depth_mm,
        full.led_positions_mm,
        full.membrane,
        shadows=terms.shadows,
        workers=workers,
    )
    slope_x, slope_y = slopes.slope_x, slopes.slope_y
    if not terms.ray_true_slopes:
        slope_x, slope_y = (slopes.normals[..., k] / slopes.normals[..., 2] for k in (0, 1))
    if not terms.weights:
        plain = integrate_slopes(slope_x, slope_y, pitch_mm=pitch_mm, workers=workers)
        return slopes, np.asarray(plain.depth_mm, np.float32), "held"
    weight, hold = slopes.weight, None
    if terms.free_rim:
        weight, hold = _rim_weights(field, weight, pitch_mm)
    solved = integrate_weighted(
        slope_x,
        slope_y,
        weight,
        pitch_mm=pitch_mm,
        start_mm=depth_mm,
        hold=hold,
        workers=workers,
    )
    return slopes, solved.depth_mm, "held" if hold is None else "free"


def _rim_weights(field: ShadedField, weight: Map, pitch_mm: float) -> tuple[Map, Map | None]:
    """Return the weights, and how firmly the border is held (None: everywhere)."""
    let_go = released_rim(field, pitch_mm)
    if not let_go.any():
        return weight, None
    hold = np.where(let_go, LET_GO, 1.0).astype(np.float32)
    return np.where(field.inside, weight, weight * hold), hold


def shaded_field(
    rgb: Map, calibration: Calibration, full: FullModel, *, terms: Terms = ALL_TERMS
) -> ShadedField:
    """Resample a raw picture and compare it with the background.

    Parameters
    ----------
    rgb, calibration, full, terms
        As for :func:`reconstruct_full`.
    """
    table = calibration.table
    seen = table.apply(rgb)
    bad = ~np.isfinite(seen)
    seen[bad] = 0.0
    light = unmix(seen, calibration.crosstalk)
    missing = bad
    if terms.saturation:
        missing = bad | (table.apply((rgb >= SATURATED).astype(np.float32)) > 0.0)
    base = np.maximum(full.background, LEAST_BASE)
    usable = table.valid & (full.background > LEAST_BASE).all(axis=2)
    usable &= (calibration.factors > 0.0).all(axis=2)
    sigma = (calibration.noise / np.sqrt(2.0) / base).astype(np.float32)
    ratio = np.asarray(light / base, np.float32)
    if terms.denoising:
        ratio, sigma = quiet_even_parts(light, base, sigma, usable)
    ratio = np.where(usable[..., None], ratio, 1.0).astype(np.float32)
    grid = table.grid
    return ShadedField(
        ratio,
        sigma,
        neighbourhood(ratio, usable, grid.pitch_mm, full.membrane.bounce_reach_mm),
        missing,
        usable,
        filled_inside(usable),
        table.drift,
        grid.x_mm,
        grid.y_mm,
    )


def released_rim(field: ShadedField, pitch_mm: float) -> NDArray[np.bool_]:
    """Return the nodes at which a contact crosses the rim of what is seen.

    There depth 0 outside would be wrong (PHYSICS, integration); elsewhere the rim stays held, so
    that the membrane that is not in contact anchors the depth.
    """
    disturbed = np.abs(field.around - 1.0).max(axis=2) > RIM_CHANGE
    return crossed_rim(field.inside, disturbed, pitch_mm)


def crossed_rim(
    inside: NDArray[np.bool_], disturbed: NDArray[np.bool_], pitch_mm: float
) -> NDArray[np.bool_]:
    """Return the nodes about those next to the rim whose neighbourhood is disturbed."""

    def disc(radius_mm: float) -> NDArray[np.uint8]:
        size = 2 * max(round(radius_mm / pitch_mm), 1) + 1
        return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)

    seen = inside.astype(np.uint8)
    core = cv2.erode(seen, disc(RIM_MM), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    touched = (disturbed & (seen > 0) & (core == 0)).astype(np.uint8)
    if not touched.any():
        return np.zeros(seen.shape, dtype=bool)
    return np.asarray(cv2.dilate(touched, disc(RIM_REACH_MM)) > 0)


def filled_inside(usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the usable area with its holes filled: specks, dust, an LED in view."""
    return np.asarray(binary_fill_holes(usable))


def coarsen(field: ShadedField) -> ShadedField:
    """Average the field over blocks of nodes; a block counts where all of it does."""
    rows, columns = (n // COARSE for n in field.usable.shape)

    def average(values: Map) -> Map:
        whole = np.ascontiguousarray(values[: rows * COARSE, : columns * COARSE], np.float32)
        return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))

    def middle(axis_mm: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        return np.asarray(axis_mm[: count * COARSE].reshape(count, COARSE).mean(axis=1))

    return ShadedField(
        average(field.ratio),
        average(field.sigma) / np.float32(COARSE),
        average(field.around),
        average(field.saturated.astype(np.float32)) > 0.5,
        average(field.usable.astype(np.float32)) > 0.99,
        average(field.inside.astype(np.float32)) > 0.5,
        average(field.drift),
        middle(field.x_mm, columns),
        middle(field.y_mm, rows),
    )


def _placed(
    slopes: RaySlopes,
    depth_mm: Map,
    placed: tuple[Map, Map, NDArray[np.bool_]],
    changes: tuple[float, ...],
    said: tuple[str, str],
) -> FullDepth:
    column, row, folded = placed
    depth = resample(depth_mm, column, row)
    normals = np.stack(
        [resample(np.ascontiguousarray(slopes.normals[..., k]), column, row) for k in range(3)],
        axis=-1,
    )
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flags = resample(slopes.flags.astype(np.float32), column, row, nearest=True).astype(np.uint8)
    flags[folded] |= int(Flag.NOT_OBSERVABLE)
    outside = (flags & int(Flag.OUTSIDE)) != 0
    depth[outside] = 0.0
    return FullDepth(depth, normals, flags, changes, *said)


def _noise(
    rgb: Map,
    calibration: Calibration,
    full: FullModel,
    field: ShadedField,
    depth_mm: Map,
    slopes: RaySlopes,
    placed: tuple[Map, Map, NDArray[np.bool_]],
    workers: int,
) -> DepthNoise:
    """Follow the picture's noise, and the model's misfit, to the metric grid."""
    table, (column, row, _) = calibration.table, placed
    light = np.nan_to_num(table.apply(rgb), posinf=0.0, neginf=0.0)
    unmixed = unmix(light, calibration.crosstalk)
    count = pixels_per_node(table)
    base = np.maximum(full.background, LEAST_BASE)
    left, left_placed = (
        noise_left(unmixed, base, field.usable, count, resampled=times) for times in (1, 2)
    )
    variance = picture_noise(rgb).at(light) @ (np.linalg.inv(calibration.crosstalk).T ** 2)
    sd = np.asarray(left[..., None] * np.sqrt(variance) / base, np.float32)
    sd = np.maximum(sd, LEAST_NOISE)
    noise = slope_noise(field, depth_mm, sd, full.led_positions_mm, full.membrane, workers=workers)
    pitch = table.grid.pitch_mm
    weight, hold = _rim_weights(field, slopes.weight, pitch)
    # A block's average has the noise of all raw pixels in it; no filter takes from that.
    block = 1.0 / (COARSE * np.sqrt(count) * left)
    white = depth_examples(noise, block, weight, hold, pitch_mm=pitch, workers=workers)
    times = model_times(field.ratio, sd, full.misfit)
    model = depth_examples(
        noise,
        times,
        weight,
        hold,
        pitch_mm=pitch,
        reach_mm=full.decay_mm,
        examples=MODEL_EXAMPLES,
        workers=workers,
    )
    examples, depth_sd = place_examples(white, slopes, field.drift, column, row)
    _, model_sd = place_examples(model, slopes, field.drift, column, row)
    # Bringing normals to true positions averages them once more.
    slope_sd = np.sqrt((noise.moved**2).sum(axis=0)) * left_placed / left
    slope_model_sd = np.sqrt(((noise.moved * times) ** 2).sum(axis=0))
    return DepthNoise(
        resample(slope_sd, column, row),
        depth_sd,
        resample(slope_model_sd, column, row),
        model_sd,
        examples,
    )
