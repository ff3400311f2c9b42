"""Reduce the noise in uniform areas of an image and keep its edges.

A normal is not a linear function of the image: near an LED's mirror image a channel hardly
changes with the slope, and noise there tilts the surface to one side instead of both. Averaging a
few pixels before the solve removes that. On walls and edges, where averaging would cost
sharpness and the signal is strong, the image is used as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.robust import SD_OF_MEDIAN
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.compiled import single, whole

from .kernel_structures import RatioImage

QUIET_PX = 1.2
LEAST = np.float32(1e-9)
USABLE = np.float32(1e-6)
"""Background of a node that is usable; of others the noise is unknown."""
CALM = 0.01
"""Relative noise below which the nonlinear effect of noise on normals is not visible."""
SIGNIFICANT = 4.0
LOUD, FEW = 1.25, 1e-3
"""Wider averages are skipped if at most this share of uniform nodes exceeds this multiple of
`CALM`."""


def denoise_ratio(
    image: RatioImage,
    sd: tuple[np.float32, ...],
    workers: RowThreadPool,
    take: Callable[..., NDArray[Any]],
) -> Float32Array | None:
    """Average the uniform areas of press over background, and update its noise.

    Press and background are averaged in the same way, so that neither the decrease of the light nor
    a speck of the membrane affects their ratio. Where the noise exceeds `CALM` because of little
    light, wider averages are used if the image is uniform over them.

    Parameters
    ----------
    image : RatioImage
        At full scale; its noise is `sd` over the background. Ratio and noise are overwritten.
    sd : 3 floats
        Noise of press minus background.
    workers : RowThreadPool
        Threads for blocks of rows.
    take : callable
        Lends work arrays.

    Returns
    -------
    (rows, columns) float32 or None
        Share of its own value that each node keeps in the narrowest average, 0..1; None if the
        image has so little noise that it was not averaged.
    """
    ratio, noise = image.ratio, image.noise
    rows, columns = image.marks.shape
    # Light and background, three channels each.
    both = take("light and base", (6, rows, columns))
    light, base = both[:3], both[3:]
    workers.run(rows, _parted, ratio, noise, sd, light, base)
    narrow = take("quiet", both.shape)
    workers.run(len(both), _average, both, QUIET_PX, narrow)
    pixel_noise = _own_noise(light, base, narrow[:3])
    # Below this relative noise, denoising has no visible effect.
    if pixel_noise is None or _relative(pixel_noise, base) < 1e-3:
        return None
    own_share: Float32Array | None = None
    edge = take("edge", (rows, columns))
    for width in (QUIET_PX * times for times in (1.0, 2.0, 4.0, 8.0)):
        if own_share is not None and not _noisy(noise, base, own_share):
            break
        wide = np.empty_like(both)
        workers.run(len(both), _average, both, 2.0 * width, wide)
        workers.run(rows, _excess, narrow, wide, base, pixel_noise, _left(width), edge)
        reach = 2 * round(2.0 * width / QUIET_PX) + 1
        grown = np.asarray(cv2.dilate(edge, np.ones((reach, reach), np.uint8)), np.float32)
        spread = np.empty_like(edge)
        _blurred(grown, 1.5 * width / QUIET_PX, spread)
        share = single(1.0 / (2.0 * np.sqrt(np.pi) * width))
        everywhere = width == QUIET_PX
        workers.run(rows, _mixed, narrow, spread, base, sd, share, everywhere, ratio, noise)
        narrow = wide
        own_share = spread if own_share is None else own_share
    return own_share


def _own_noise(
    light: Float32Array, base: Float32Array, average: Float32Array
) -> tuple[Float32Array, Float32Array] | None:
    """Return a pixel's noise as variance without light, and per unit of light, (3,) each.

    Robust, from the darker and the brighter third of what is usable; None where nothing is.
    """
    step = max(int(np.sqrt(light[0].size / 8000)), 1)
    thin = np.s_[step // 2 :: step, step // 2 :: step]
    read, shot = np.zeros(3, np.float32), np.zeros(3, np.float32)
    for k in range(3):
        usable = base[k][thin] > USABLE
        if not usable.any():
            return None
        light_sample = light[k][thin][usable]
        deviation = np.abs(light_sample - average[k][thin][usable])
        dark, bright = np.percentile(light_sample, [33.0, 67.0])
        low, high = light_sample <= dark, light_sample >= bright
        variance = [(SD_OF_MEDIAN * np.median(deviation[part])) ** 2 for part in (low, high)]
        level = [np.median(light_sample[part]) for part in (low, high)]
        shot[k] = max((variance[1] - variance[0]) / max(level[1] - level[0], LEAST), 0.0)
        read[k] = max(variance[0] - shot[k] * level[0], LEAST)
    return read, shot


def _relative(pixel_noise: tuple[Float32Array, Float32Array], base: Float32Array) -> float:
    """Return the noise of press over background at the darker end of the light."""
    max_noise = 0.0
    for k, (read, shot) in enumerate(zip(*pixel_noise, strict=True)):
        thin = base[k][::8, ::8]
        level = float(np.percentile(thin[thin > USABLE], 10.0))
        max_noise = max(max_noise, float(np.sqrt(read + shot * level)) / level)
    return max_noise


def _left(width_px: float) -> np.float32:
    """Return the significant difference between two averages, for white noise of sd 1."""
    wide_px = 2.0 * width_px
    difference_sd = np.sqrt(1.0 / width_px**2 + 1.0 / wide_px**2 - 4.0 / (width_px**2 + wide_px**2))
    return single(SIGNIFICANT * difference_sd / np.sqrt(4.0 * np.pi))


def _average(
    first: int, last: int, planes: Float32Array, width_px: float, result: Float32Array
) -> None:
    for plane, target in zip(planes[first:last], result[first:last], strict=True):
        _blurred(plane, width_px, target)


def _blurred(plane: Float32Array, width_px: float, result: Float32Array) -> None:
    """Write the average over a Gaussian, which is computed on blocks of pixels if it is wide."""
    block = int(width_px / QUIET_PX / 2.0)
    if block < 2:
        cv2.GaussianBlur(plane, (0, 0), width_px, result)
        return
    rows, columns = plane.shape
    size = (-(-columns // block), -(-rows // block))
    small = cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
    # The blocks themselves average already.
    spread_px = np.sqrt(width_px**2 - (block**2 - 1.0) / 12.0) / block
    small = cv2.GaussianBlur(small, (0, 0), float(spread_px))
    cv2.resize(small, (columns, rows), result, interpolation=cv2.INTER_LINEAR)


def _noisy(noise: Float32Array, base: Float32Array, edge: Float32Array) -> bool:
    """Return whether uniform areas have more noise than `CALM`."""
    thin = np.s_[..., ::2, ::2]
    # A node in a uniform area keeps at most half of its own value.
    loud = (noise[thin] > LOUD * CALM) & (base[thin] > USABLE) & (edge[thin] < 0.5)
    return bool(np.count_nonzero(loud) > FEW * loud[0].size)


@whole
def _parted(first, last, ratio, noise, sd, light, base):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write light and background of each node, nearly 0 where it is not usable."""
    for i in range(first, last):
        for k in range(3):
            r, n, l, b = ratio[k, i], noise[k, i], light[k, i], base[k, i]  # noqa: E741
            noise_sd = sd[k]
            for j in range(r.shape[0]):
                below = noise_sd / n[j]
                b[j] = below
                l[j] = r[j] * below


@whole
def _excess(first, last, narrow, wide, base, pixel_noise, limit, edge):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write how far two averages differ beyond what noise makes of them, 0..1."""
    light, below, wide_light, wide_below = narrow[:3], narrow[3:], wide[:3], wide[3:]
    least, none, one = single(LEAST), single(0.0), single(1.0)
    line = np.empty(edge.shape[1], np.float32)
    for i in range(first, last):
        line[:] = none
        for k in range(3):
            read, shot = pixel_noise[0][k], pixel_noise[1][k]
            a, b, c, d = light[k, i], below[k, i], wide_light[k, i], wide_below[k, i]
            reference = base[k, i]
            for j in range(line.shape[0]):
                # |a / b - c / d| over limit * sqrt(variance) / b
                variance = read + shot * (a[j] if a[j] > none else none)
                off = abs(a[j] * d[j] - c[j] * b[j])
                excess = off / (limit * np.sqrt(variance) * d[j] + least) - one
                excess = excess if reference[j] > USABLE else none
                line[j] = excess if excess > line[j] else line[j]
        for j in range(line.shape[0]):
            edge[i, j] = line[j] if line[j] < one else one


@whole
def _mixed(first, last, narrow, edge, base, sd, left, everywhere, ratio, noise):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Move ratio and noise towards the average's, where there is no edge and need of it."""
    light, below = narrow[:3], narrow[3:]
    least, none, one = single(LEAST), single(0.0), single(1.0)
    per_calm = single(1.0 / CALM)
    always = one if everywhere else none
    for i in range(first, last):
        own_share = edge[i]
        for k in range(3):
            r, n, a, b, c = ratio[k, i], noise[k, i], light[k, i], below[k, i], base[k, i]
            average_sd = sd[k] * left
            for j in range(own_share.shape[0]):
                need = n[j] * per_calm - one
                need = need if need < one else one
                need = need if need > always else always
                share = (one - own_share[j]) * need if c[j] > USABLE else none
                r[j] += share * (a[j] / (b[j] + least) - r[j])
                n[j] += share * (average_sd / (c[j] + least) - n[j])
