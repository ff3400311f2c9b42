"""Effect of noise and of model errors on slopes and depth of the near-light model.

Slopes: each channel is changed by plus and minus its noise and the normals are solved again, with
the conditioning, missing channels and weights of the result. Depth: random fields of slope errors
are integrated with the weights of the result at quarter scale. Noise is white; each octave of its
wavelengths adds equally to the variance of the depth. Quarter scale leaves out two octaves, of
which the average of uniform areas has removed most. Repeated images scatter by this, and by the
error of the correction of their light. Errors of the model, known from the ball presses, are
correlated over lengths like that of the drape and occur only where the membrane is deformed; they
are equal in every repeat and different in every press.
Errors of the calibration are common to all presses and are stored with it
(:class:`ScaleUncertainty`).

Outside the solved region the depth is 0 in every repeat; its error is part of the model error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.health.contact_residual import ContactLightResidual
from gelpolight_core.reconstruction.compiled import whole
from gelpolight_core.reconstruction.height_map import COARSE
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.solver import DepthNoise

from .denoise import QUIET_PX
from .image_noise import ImageNoise
from .kernel import STEEPEST_NZ
from .kernel_structures import PyramidLevel, RegionSlopes, slopes_like
from .membrane_interreflection import light_in_shadows, received
from .region_solution import SolvedRegion
from .sensor_maps import SensorMaps, block_average

EXAMPLES = 64
"""The standard deviation of 64 examples is known to 1 / sqrt(128), a twelfth of itself."""
DEPARTURE = 0.3
"""Typical deviation of press over background from 1 in ball presses, to which the misfit of the
joint refinement belongs. Where the membrane is less deformed, the error is smaller."""
TOLERANCE = 0.03
"""An example needs an accuracy of a few percent only."""
LEAST_NOISE = 1e-5
"""Share of the brightness below the noise of any camera; 0 would hide the conditioning."""
LEAST_DEPTH_MM = 1e-3
"""Depth below which a share of it says nothing."""
LEFT_OUT_MM, LEFT_OUT_SLOPE = 2e-3, 3e-3
"""Standard deviation of depth and slope outside the solved region, where they are 0."""

Solve = Callable[[Float32Array, tuple[Float32Array, Float32Array]], RegionSlopes]


@dataclass(frozen=True, slots=True)
class SlopeNoise:
    """Effect of the noise of each channel on the slopes.

    Attributes
    ----------
    moved_x, moved_y : (3, rows, columns) float32
        Change of the slopes along the rays by one standard deviation of each channel's noise.
    moved : (3, rows, columns) float32
        Size of the change of the surface's slopes, the root mean square of x and y.
    """

    moved_x: Float32Array
    moved_y: Float32Array
    moved: Float32Array


def no_contact_noise(shape: tuple[int, ...]) -> DepthNoise:
    """Return the uncertainty of a map without a solved region."""
    rows, columns = shape
    zero, depth, slope = (
        np.full(shape, value, np.float32) for value in (0.0, LEFT_OUT_MM, LEFT_OUT_SLOPE)
    )
    examples = np.zeros((EXAMPLES, rows // COARSE, columns // COARSE), np.float32)
    return DepthNoise(zero, zero.copy(), slope, depth, examples)


def depth_noise(
    answer: SolvedRegion,
    maps: SensorMaps,
    noise: ImageNoise,
    solve: Solve,
    workers: RowThreadPool,
    contact: ContactLightResidual,
    *,
    light_sd: NDArray[np.float64] | None = None,
    share_sd: float = 0.0,
) -> DepthNoise:
    """Propagate the noise of an image and the errors of the model to the metric grid.

    Parameters
    ----------
    answer : SolvedRegion
        Solution of the region.
    maps : SensorMaps
        Precomputed calibration data.
    noise : ImageNoise
        Noise of the raw image.
    solve : function
        Returns the slopes of another ratio (3, rows, columns), from first normals (x, y) that it
        overwrites.
    workers : RowThreadPool
        Threads for blocks of rows.
    contact : ContactLightResidual
        Light of the contact that the surface does not explain.
    light_sd : (3,), optional
        Standard deviation of each channel's gain, where the image was corrected for it.
    share_sd : float, optional
        Standard deviation of the share of the frame before, where the image was corrected for it.
    """
    window, shape = answer.region.window(COARSE), answer.region.at(COARSE)[1]
    count = pixels_per_node(maps.calibration.table, window)
    edge, kernel = answer.compared.edge, answer.compared.kernel
    share, placed_share = (
        residual_noise_share(edge, count, resampled=n, kernel=kernel) for n in (1, 2)
    )
    sd = _ratio_sd(answer.compared.fine.ratio, maps, noise, share, window, workers)
    moves = slope_noise(answer.compared.fine.ratio, sd, answer.slopes, solve)
    # A block's average has the noise of all raw pixels in it; no filter reduces that.
    block = (1.0 / (COARSE * np.sqrt(count) * share)).astype(np.float32)
    # Errors of walls change the light that these receive.
    grown = 1.0 / (1.0 - answer.light_rounds.gain)
    misfit = contact.times * maps.full.misfit * grown
    times = model_times(answer.compared.fine.ratio, sd, misfit)
    coarse = maps.scale(COARSE)
    white = depth_examples(moves, block, answer, coarse.pitch_mm, workers=workers)
    model = depth_examples(
        moves,
        times,
        answer,
        coarse.pitch_mm,
        reach_mm=maps.full.decay_mm,
        # Few: the errors of the model are known less accurately anyway.
        examples=16,
        workers=workers,
    )
    # Each image has its own light, and with it its own error of the correction.
    shares = [] if light_sd is None else [*np.diag(light_sd.astype(np.float32))[..., None, None]]
    if contact.darkening > 0.0:
        normal_x, normal_y = answer.slopes.normal_x, answer.slopes.normal_y
        down = np.sqrt(np.maximum(1.0 - normal_x**2 - normal_y**2, STEEPEST_NZ**2))
        shares.append(np.float32(contact.darkening) * (1.0 / down - 1.0)[None])
    relative = answer.compared.fine.ratio / sd
    errors = [error * relative for error in shares]
    if share_sd > 0.0:
        errors.append(np.float32(share_sd) * (1.0 - answer.compared.fine.ratio) / sd)
    if answer.compared.fine.around.shape[2] > 1:
        normal_x, normal_y = answer.slopes.normal_x, answer.slopes.normal_y
        down = -np.sqrt(np.maximum(1.0 - normal_x**2 - normal_y**2, 0.0))
        normals = np.stack([normal_x, normal_y, down])
        shadows = light_in_shadows(answer.compared.fine, normals)[:, None, None]
        errors.append(shadows * received(answer.compared.fine.around, normals) / sd)
    for number, times_light in enumerate(errors):
        moved = light_errors(moves, times_light, answer, coarse)
        drawn = np.random.default_rng(number).standard_normal((EXAMPLES, 1, 1), np.float32)
        white += drawn * moved
    placed, placed_model = (resample_examples(e, answer, coarse) for e in (white, model))
    result = no_contact_noise(maps.flags.shape)
    # Moving normals to true positions averages them again.
    slope_sd = np.sqrt((moves.moved**2).sum(axis=0)) * placed_share / share
    slope_model_sd = np.sqrt(((moves.moved * times) ** 2).sum(axis=0))
    result.slope_sd[window] = _at(slope_sd, answer.position)
    result.slope_model_sd[window] = _at(slope_model_sd, answer.position)
    result.depth_sd_mm[window] = _root_mean_square(placed, shape)
    model_sd = _root_mean_square(placed_model, shape)
    depth_mm = _at(answer.depth_mm, answer.position)
    one_sided = answer.boundary.depth_sd * np.abs(depth_mm)
    level_sd = np.hypot(one_sided, answer.boundary.level_sd_mm)
    level_sd = np.hypot(level_sd, wall_sd_mm(depth_mm))
    # What more rounds would add is nearly a share of the depth.
    left = answer.light_rounds.left_mm / max(float(answer.depth_mm.max()), LEAST_DEPTH_MM)
    level_sd = np.hypot(level_sd, left * np.abs(depth_mm))
    result.depth_model_sd_mm[window] = np.hypot(model_sd, level_sd)
    result.noise_mm[(slice(None), *answer.region.window(1))] = placed
    return result


def wall_sd_mm(depth_mm: Float32Array) -> Float32Array:
    """Return the standard deviation (rows, columns) of the depth at walls, from their position.

    A wall lies somewhere within its node: it can be off by one node over the root of 12, times the
    slope of the steepest neighbour. Small images of deep presses have few nodes on a wall.
    """
    down, across = np.gradient(depth_mm)
    steepest = cv2.dilate(np.hypot(down, across).astype(np.float32), np.ones((3, 3), np.uint8))
    return np.asarray(steepest / np.float32(np.sqrt(12.0)))


def _ratio_sd(
    ratio: Float32Array,
    maps: SensorMaps,
    noise: ImageNoise,
    share: Float32Array,
    window: tuple[slice, slice],
    workers: RowThreadPool,
) -> Float32Array:
    """Return the standard deviation (3, rows, columns) of press over background."""
    mix = maps.calibration.crosstalk.astype(np.float32)
    unmix = np.linalg.inv(maps.calibration.crosstalk) ** 2
    base = np.ascontiguousarray(maps.full.background[window])
    # A step of a hundredth of the light: the curves are straight lines between few levels.
    levels = np.linspace(0.0, 1.0, 101, dtype=np.float32)
    table = noise.at(np.repeat(levels[None, None], 3, axis=0))[:, 0]
    sd = np.empty_like(ratio)
    workers.run(
        len(share), _noise_of_ratio, ratio, base, mix, unmix.astype(np.float32), table, share, sd
    )
    return sd


@whole
def _noise_of_ratio(first, last, ratio, background, mix, unmix, table, share, sd):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    least = np.float32(LEAST_NOISE)
    variance = np.empty(3, np.float32)
    top = table.shape[1] - 1
    for i in range(first, last):
        for j in range(share.shape[1]):
            for k in range(3):
                light = np.float32(0.0)
                for c in range(3):
                    light += mix[k, c] * ratio[c, i, j] * background[i, j, c]
                position = min(max(light, np.float32(0.0)), np.float32(1.0)) * np.float32(top)
                n = min(int(position), top - 1)
                rest = position - np.float32(n)
                variance[k] = table[k, n] + rest * (table[k, n + 1] - table[k, n])
            for k in range(3):
                total = np.float32(0.0)
                for c in range(3):
                    total += unmix[k, c] * variance[c]
                value = share[i, j] * np.sqrt(total) / max(background[i, j, k], least)
                sd[k, i, j] = max(value, least)


def slope_noise(
    ratio: Float32Array, ratio_sd: Float32Array, slopes: RegionSlopes, solve: Solve
) -> SlopeNoise:
    """Move each channel by its noise, and solve the normals again.

    Parameters
    ----------
    ratio, ratio_sd : (3, rows, columns) float32
        Press over background, and its standard deviation, > 0.
    slopes : RegionSlopes
        Slopes of the result.
    solve : function
        As for :func:`depth_noise`.
    """
    moved_x, moved_y, moved = (np.empty_like(ratio) for _ in range(3))
    shaken = ratio.copy()
    high = slopes_like(ratio[0])
    for k in range(3):
        for sign in (1.0, -1.0):
            np.add(ratio[k], np.float32(sign) * ratio_sd[k], out=shaken[k])
            moved_slopes = solve(shaken, (slopes.normal_x.copy(), slopes.normal_y.copy()))
            if sign > 0.0:
                high.slope_x[:], high.slope_y[:] = moved_slopes.slope_x, moved_slopes.slope_y
                high.normal_x[:], high.normal_y[:] = moved_slopes.normal_x, moved_slopes.normal_y
        shaken[k] = ratio[k]
        _half_differences(high, moved_slopes, moved_x[k], moved_y[k], moved[k])
    return SlopeNoise(moved_x, moved_y, moved)


@whole
def _half_differences(high, low, moved_x, moved_y, moved):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    half, least, one = np.float32(0.5), np.float32(1e-6), np.float32(1.0)
    for i in range(moved.shape[0]):
        for j in range(moved.shape[1]):
            moved_x[i, j] = half * (high.slope_x[i, j] - low.slope_x[i, j])
            moved_y[i, j] = half * (high.slope_y[i, j] - low.slope_y[i, j])
            a, b = high.normal_x[i, j], high.normal_y[i, j]
            c, d = low.normal_x[i, j], low.normal_y[i, j]
            up = one / np.sqrt(max(one - a * a - b * b, least))
            down = one / np.sqrt(max(one - c * c - d * d, least))
            x, y = a * up - c * down, b * up - d * down
            moved[i, j] = np.sqrt(np.float32(0.125) * (x * x + y * y))


def depth_examples(
    noise: SlopeNoise,
    times: Float32Array,
    answer: SolvedRegion,
    pitch_mm: float,
    *,
    reach_mm: float = 0.0,
    examples: int = EXAMPLES,
    workers: RowThreadPool,
) -> Float32Array:
    """Integrate examples of slope errors at quarter scale.

    Parameters
    ----------
    noise : SlopeNoise
        At full scale.
    times : (3, rows, columns) or (rows, columns) float32
        Error of an average over 4 x 4 nodes, in standard deviations of `noise`.
    answer : SolvedRegion
        Its weights are used.
    pitch_mm : float
        Distance between nodes at quarter scale.
    reach_mm : float, optional
        Correlation length of the errors; 0: they are white.
    examples : int, optional
        How many.
    workers : RowThreadPool
        Threads for blocks of rows.

    Returns
    -------
    (examples, rows / 4, columns / 4) float32
        Along the rays.
    """
    moved_x, moved_y = (
        np.stack([block_average(m, COARSE) for m in part * times])
        for part in (noise.moved_x, noise.moved_y)
    )
    # Two draws with the covariance that three channels' noise gives the two slopes.
    along = np.sqrt((moved_x**2).sum(axis=0))
    across = (moved_x * moved_y).sum(axis=0) / np.maximum(along, 1e-12)
    independent = np.sqrt(np.maximum((moved_y**2).sum(axis=0) - across**2, 0.0))
    depth = _integration(answer, pitch_mm)
    sigma = reach_mm / (pitch_mm * np.sqrt(2.0))
    depths_mm = np.empty((examples, *along.shape), np.float32)

    def draw(first: int, last: int) -> None:
        for n in range(first, last):
            # Each example has its own source, so that the threads do not matter.
            random = np.random.default_rng(n)
            drawn = random.standard_normal((2, *along.shape), dtype=np.float32)
            if sigma > 0.0:
                drawn = np.stack([cv2.GaussianBlur(d, (0, 0), sigma) for d in drawn])
                drawn /= drawn.std()
            depths_mm[n] = depth(along * drawn[0], across * drawn[0] + independent * drawn[1])

    workers.run(examples, draw)
    return depths_mm


def light_errors(
    noise: SlopeNoise, times: Float32Array, answer: SolvedRegion, coarse: PyramidLevel
) -> Float32Array:
    """Integrate an error of the light, at quarter scale.

    Parameters
    ----------
    noise : SlopeNoise
        Slopes moved by each channel.
    times : (3, rows, columns) float32
        Error of each channel, in standard deviations of `noise`.
    answer : SolvedRegion
        Its weights are used.
    coarse : PyramidLevel
        Coarsest scale of the whole grid.

    Returns
    -------
    (rows / 4, columns / 4) float32
        Depth along the rays.
    """
    depth = _integration(answer, coarse.pitch_mm)
    slopes = ((part * times).sum(axis=0) for part in (noise.moved_x, noise.moved_y))
    return depth(*(block_average(slope, COARSE) for slope in slopes))


def _integration(
    answer: SolvedRegion, pitch_mm: float
) -> Callable[[Float32Array, Float32Array], Float32Array]:
    """Return what integrates slopes at quarter scale with the weights of a result."""
    weight = block_average(answer.weight, COARSE)
    hold = None if answer.hold is None else block_average(answer.hold, COARSE)

    def depth(slope_x: Float32Array, slope_y: Float32Array) -> Float32Array:
        integral = integrate_weighted(
            slope_x, slope_y, weight, pitch_mm=pitch_mm, hold=hold, tolerance=TOLERANCE
        )
        return integral.depth_mm

    return depth


def model_times(ratio: Float32Array, ratio_sd: Float32Array, misfit: float) -> Float32Array:
    """Return the model's own error in units of the noise, (3, rows, columns).

    Parameters
    ----------
    ratio, ratio_sd : (3, rows, columns) float32
        Press over background and its noise.
    misfit : float
        Residual of the joint refinement on the ball presses.
    """
    disturbed = np.minimum(np.abs(ratio - 1.0) / DEPARTURE, 1.0)
    return np.asarray(misfit * disturbed / ratio_sd, np.float32)


def resample_examples(
    examples_mm: Float32Array, answer: SolvedRegion, coarse: PyramidLevel
) -> Float32Array:
    """Bring examples (examples, rows / 4, columns / 4) from the rays to true positions.

    Parameters
    ----------
    examples_mm : (examples, rows / 4, columns / 4) float32
        Along the rays.
    answer : SolvedRegion
        Its normals and places.
    coarse : PyramidLevel
        Coarsest scale of the whole grid.
    """
    ray_x, ray_y = coarse.rays[:2][(slice(None), *answer.region.window(1))]
    normal_x, normal_y = (
        block_average(n, COARSE) for n in (answer.slopes.normal_x, answer.slopes.normal_y)
    )
    down = -np.sqrt(np.maximum(1.0 - normal_x**2 - normal_y**2, 1e-3))
    # A ray's point slides along the surface as it goes deeper: D(P0 + d w) = d.
    stretch = np.abs((down - normal_x * ray_x - normal_y * ray_y) / down)
    first = np.float32(0.5 * (COARSE - 1))
    at = np.stack(
        [(block_average(p, COARSE) - first) / np.float32(COARSE) for p in answer.position]
    )
    return np.stack([_at(e * stretch, at) for e in examples_mm])


def _at(values: Float32Array, position: Float32Array) -> Float32Array:
    """Return values of the rays at true positions."""
    return np.asarray(
        cv2.remap(
            np.asarray(values, np.float32),
            position[0],
            position[1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def _root_mean_square(examples_mm: Float32Array, shape: tuple[int, int]) -> Float32Array:
    variance = cv2.resize(np.mean(examples_mm**2, axis=0), shape[::-1])
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)), np.float32)


def _variance_gain(kernel: Float32Array, resampled: int) -> float:
    """Return what a kernel makes of the variance of bilinearly resampled noise.

    Averaged over where nodes fall between the pixels, neighbours share a sixth of a pixel's
    variance along each axis, and a node has two thirds.
    """
    tent = np.array([1.0, 4.0, 1.0]) / 6.0
    line = tent if resampled == 1 else np.convolve(tent, tent)
    pixel_covariance = np.outer(line, line)
    correlation = correlate(np.pad(kernel, len(kernel) // 2), kernel, mode="constant")
    middle, reach = len(correlation) // 2, len(line) // 2
    near = correlation[middle - reach : middle + reach + 1, middle - reach : middle + reach + 1]
    return float((near * pixel_covariance).sum() / pixel_covariance[reach, reach])


def residual_noise_share(
    edge: Float32Array | None,
    pixels_per_node: Float32Array,
    *,
    resampled: int,
    kernel: Float32Array,
) -> Float32Array:
    """Return the share (rows, columns) of a raw pixel's noise that a denoised node still has.

    Bilinear resampling (a tent of variance 1/6 pixel^2 per axis) and the average over `QUIET_PX`
    are taken together as Gaussians. Where the image is left as it is, the tents alone count:
    averaged over where a node falls between the pixels, one leaves 2/3 of the variance per axis,
    two together (a cubic B-spline) leave 151/315. Wider averages are not included.

    Parameters
    ----------
    edge : (rows, columns) float32 or None
        Share of its own value that a node keeps, 0..1; None: 1 everywhere.
    pixels_per_node : (rows, columns) float32
        Raw pixels in the area of one node.
    resampled : int
        How many times, 1 or 2.
    kernel : (size, size) float32
        What was applied to the image where it was left as it is, after resampling it once.
    """
    own_share = np.ones_like(pixels_per_node) if edge is None else edge
    tent = resampled / (3.0 * pixels_per_node)
    bare = {1: 2.0 / 3.0, 2: 151.0 / 315.0}[resampled] ** 2 * _variance_gain(kernel, resampled)

    def shared(average_px2: float) -> Float32Array:
        return np.asarray(1.0 / (2.0 * np.pi * pixels_per_node * (average_px2 + tent)))

    average_share = 1.0 - own_share
    variance = average_share**2 * shared(2.0 * QUIET_PX**2) + own_share**2 * bare
    variance += 2.0 * average_share * own_share * shared(QUIET_PX**2)
    return np.sqrt(variance).astype(np.float32)


def pixels_per_node(table: ResamplingTable, window: tuple[slice, slice]) -> Float32Array:
    """Return how many raw pixels lie in the area of one node of a region, (rows, columns)."""
    u_row, u_column = np.gradient(table.u_px[window])
    v_row, v_column = np.gradient(table.v_px[window])
    count = np.abs(u_column * v_row - u_row * v_column)
    # At the edge of the visible area the differences have no meaning.
    return np.asarray(np.where(table.valid[window], np.clip(count, 0.1, 10.0), 1.0), np.float32)
