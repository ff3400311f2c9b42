"""The grain of images: how alike neighbouring pixels are, compared with distant ones.

The noise of a camera is as different between neighbours as between distant pixels, and each colour
has its own. Compression, noise reduction, resizing, blur and coarse colours make neighbours alike,
sharpening makes them differ. Other changes of the noise, by exposure, gain or an average over
frames, change both alike.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base import compiling
from gelpolight_core.base.arrays import Float32Array, Float64Array, Int32Array

from .change_detection import SIGMAS

FAR = 8
"""Distance of distant pixels: side of the blocks of a compressed image."""
BLOCK = 2 * FAR
TINY = float(np.finfo(float).tiny)
COARSEST_STEP = 4.0
"""Of images, in levels of 8 bits: those of six bits, as green has in the format RGB565."""
LEVEL_SAMPLES = 64
"""Along rows and columns: 4096 pixels use nearly all of up to 256 numbers."""


NEAR, FAR_APART, COARSE, COLOUR_NEAR, COLOUR_COARSE, EDGES = range(6)
"""Columns of the result of :func:`block_grain`."""


@dataclass(frozen=True, slots=True)
class NoiseRatio:
    """One variance of single images over another one, of the same noise.

    Attributes
    ----------
    ratio : float
        Of the noise.
    texture : float
        What the membrane's texture adds to the one, less `ratio` times what it adds to the other;
        share of full scale squared.
    texture_sd : float
        Its standard deviation.
    sd : float
        Scatter of the one from image to image, as a share.
    """

    ratio: float
    texture: float
    texture_sd: float
    sd: float

    def change(
        self, one: Float64Array, other: Float64Array, *, light: float, alike: float
    ) -> tuple[float, float]:
        """Return by how much the one lacks and exceeds, over the most that chance explains.

        Parameters
        ----------
        one, other : (blocks,)
            The variances in an image.
        light : float
            Of the image, over that at calibration.
        alike : float
            The most that rounding takes from the one or adds to the other.
        """
        measured, texture = _median(one), light**2 * self.texture
        expected = self.ratio * _median(other) + texture
        sd = math.hypot(_sd(one - self.ratio * other), self.sd * expected)
        allowed = max(SIGMAS * math.hypot(sd, light**2 * self.texture_sd), TINY)
        # A lens out of focus shows less texture.
        exceeding = measured - expected + min(texture, 0.0)
        return (expected - measured - alike) / allowed, exceeding / allowed


@dataclass(frozen=True, slots=True)
class Grain:
    """Grain of single images at calibration, with variances in shares of full scale squared.

    Attributes
    ----------
    ratio : float
        Variance of noise between neighbours over that between distant pixels; 1 for white noise.
    near, far : float
        What the membrane's texture adds at least to the one, and at most to the other.
    sd : float
        Scatter of the variance between neighbours from image to image, as a share.
    edges : float
        Largest share of the parts of an image with more variance between neighbours where a
        compressed image's blocks meet than in their middles.
    coarse : NoiseRatio or None
        Between neighbours, over that of means of four neighbours; None, as the others, in
        calibrations by programs that did not measure it.
    colour_coarse : NoiseRatio or None
        The same of the difference of two channels.
    colour : NoiseRatio or None
        Of that difference over that of the channels, between neighbours.
    """

    ratio: float
    near: float
    far: float
    sd: float
    edges: float
    coarse: NoiseRatio | None = None
    colour_coarse: NoiseRatio | None = None
    colour: NoiseRatio | None = None

    def processed(self, blocks: Float64Array, step: float, light: float = 1.0) -> float:
        """Return how alike or different neighbours are, over the most that chance explains.

        Parameters
        ----------
        blocks : (blocks, 6)
            From :func:`block_grain`.
        step : float
            Between the numbers of the image, share of full scale.
        light : float, optional
            Of the image, over that at calibration.
        """
        if not len(blocks):
            return 0.0
        near, far, coarse, colour, colour_coarse, _ = np.ascontiguousarray(blocks.T)
        noise = _median(far) - self.far - step**2 / 12.0 - SIGMAS * _sd(far)
        alike, of_means = step**2 * _rounded_alike(max(noise, 0.0) / step**2)
        expected = self.near + self.ratio * max(_median(far) - self.far, 0.0)
        sd = math.hypot(_sd(near - self.ratio * far), self.sd * expected)
        lacking = expected - _median(near) - alike - of_means
        changes = [lacking / max(SIGMAS * sd, TINY)]
        # What rounding makes alike counts four times in means of four.
        if self.coarse is not None:
            means = 4.0 * (alike + of_means)
            lacks, exceeds = self.coarse.change(near, coarse, light=light, alike=means)
            # A camera that compressed its images at calibration may not do so now.
            was_compressed = self.edges > 0.5 + _edges_by_chance(len(blocks))
            changes += [lacks] if was_compressed else [lacks, exceeds]
        if self.colour is not None and self.colour_coarse is not None:
            # Rounding of means explains the first but not the second, mixed colours only this.
            smooth, _ = self.colour_coarse.change(
                colour, colour_coarse, light=light, alike=4.0 * alike
            )
            changes.append(
                min(smooth, self.colour.change(colour, near, light=light, alike=alike)[0])
            )
        return float(max(changes))

    def in_blocks(self, blocks: Float64Array) -> float:
        """Return the excess difference of neighbours where blocks meet, over that by chance.

        Parameters
        ----------
        blocks : (blocks, 6)
            From :func:`block_grain`; pressed parts have no blocks, either.
        """
        if not len(blocks):
            return 0.0
        return (_edges(blocks) - self.edges) / _edges_by_chance(len(blocks))


def _rounded_alike(noise: float) -> Float64Array:
    """Return the most that rounding adds to the difference of distant pixels but not of neighbours.

    For single images, and what means of two images add to it.

    Parameters
    ----------
    noise : float
        Variance before rounding, in steps squared, as for the result.
    """
    # The error of rounding is a saw-tooth, of which noise leaves the long waves.
    waves = np.arange(1, 100)
    by_wave = np.exp(-noise * (2.0 * math.pi * waves) ** 2) / (2.0 * (math.pi * waves) ** 2)
    alike = float(by_wave.sum())
    # Halves are rounded to even numbers, alike over two steps: in simulated means, by up to a fifth
    # of the variance between neighbours and a 32nd.
    return np.array([alike, min(0.2 * (noise + 1.0 / 12.0 - alike), 1.0 / 32.0)])


def _median(values: Float64Array) -> float:
    return float(np.sort(values)[len(values) // 2])


def _sd(values: Float64Array) -> float:
    """Return the standard deviation of a median."""
    # Half the distance of these quantiles, 0.16 and 0.84, is a standard deviation.
    low, high = np.sort(values)[[len(values) * 4 // 25, len(values) * 21 // 25]]
    return math.sqrt(0.5 * math.pi / len(values)) * 0.5 * float(high - low)


def _edges(blocks: Float64Array) -> float:
    return float((blocks[:, EDGES] > 0.0).mean())


def _edges_by_chance(blocks: int) -> float:
    return SIGMAS * 0.5 / math.sqrt(blocks)


def grain_of(images: Sequence[Float32Array], corner: Int32Array) -> Grain | None:
    """Return the grain of images of one sensor, pressed at different places.

    Parameters
    ----------
    images : sequence of (height, width, 3) float32
        Linear light; at least three, otherwise None is returned.
    corner : (blocks, 2) int32
        As for :func:`block_grain`.
    """
    if len(images) < 3 or not len(corner):
        return None
    light = np.tile(np.linspace(-1.0, 1.0, 65536, dtype=np.float32), (3, 1))

    def grain_in(image: Float32Array) -> Float64Array:
        code = np.rint((np.clip(image, -1.0, 1.0) + 1.0) * 32767.5).astype(np.uint16)
        return block_grain(code, light, corner)

    differences = [0.5 * grain_in(after - image) for image, after in itertools.pairwise(images)]
    noise = np.median(np.concatenate(differences), axis=0)
    blocks = [grain_in(image) for image in images]
    typical = np.median(np.concatenate(blocks), axis=0)

    def noise_ratio(one: int, other: int) -> NoiseRatio:
        ratio = float(noise[one] / max(noise[other], TINY))
        sd = float(np.std([np.median(b[:, one] - ratio * b[:, other]) for b in blocks], ddof=1))
        texture = float(typical[one] - ratio * typical[other])
        # Both the noise and the whole have this error.
        texture_sd = sd * math.sqrt(2.0 / len(blocks))
        return NoiseRatio(ratio, texture, texture_sd, sd / max(float(typical[one]), TINY))

    by_far = noise_ratio(NEAR, FAR_APART)
    margin = SIGMAS * by_far.texture_sd / math.sqrt(2.0)
    near, far = (typical - noise)[[NEAR, FAR_APART]].tolist()
    return Grain(
        ratio=by_far.ratio,
        near=max(near - margin, 0.0),
        far=max(far + margin, 0.0),
        sd=by_far.sd,
        edges=max(_edges(part) for part in blocks),
        coarse=noise_ratio(NEAR, COARSE),
        colour_coarse=noise_ratio(COLOUR_NEAR, COLOUR_COARSE),
        colour=noise_ratio(COLOUR_NEAR, NEAR),
    )


def block_corners(centres: Float64Array, height: int, width: int) -> Int32Array:
    """Return corners (blocks, 2) for :func:`block_grain` about centres (blocks, 2), row and column.

    The second pixel is the first one of a block of a compressed image. There are none in an image
    that is hardly larger than a block.
    """
    max_corner = (np.array([height, width]) - BLOCK - FAR + 1) // FAR
    corners = np.clip(np.rint(centres / FAR) - 2, 0, max_corner).astype(np.int32) * FAR + FAR - 1
    return np.ascontiguousarray(corners if max_corner.min() >= 0 else corners[:0])


def block_grain(raw: NDArray[Any], light: Float32Array, corner: Int32Array) -> Float64Array:
    """Return the variance of a pixel (blocks, 6) in square parts of an image.

    By differences between neighbours, between pixels that are `FAR` apart, and between means of
    four neighbours that are `FAR` apart; by the first and the last of the difference of the first
    two channels; and what neighbours differ more where four blocks of a compressed image meet than
    in their middles. Smooth shading has no part in them.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image.
    light : (3, levels) float32
        Linear light of every number.
    corner : (blocks, 2) int32
        Row and column of the first pixel of each part, which is `BLOCK` pixels wide.
    """
    variances = np.empty((len(corner), 6))
    sums = np.empty((3, 4 * FAR), np.float32)
    _block_grain(raw, light, corner, np.empty((FAR, 4 * FAR), np.float32), sums, variances)
    return variances


@compiling.part(fastmath=True)
def _difference(raw, light, r, c, apart, k):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    upper = light[k, raw[r, c, k]] - light[k, raw[r, c + apart, k]]
    lower = light[k, raw[r + apart, c, k]] - light[k, raw[r + apart, c + apart, k]]
    return upper - lower


@compiling.whole(fastmath=True)
def _block_grain(raw, light, corner, tile, sums, variances):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    # A row of the tile has four entries for a pixel: the channels and the difference of two.
    pixels, cells = np.float32(4 * FAR * FAR), np.float32(16 * (FAR - 1) ** 2)
    for b in range(corner.shape[0]):
        r, c = corner[b, 0], corner[b, 1]
        edges = np.float32(0.0)
        for i in range(0, BLOCK, FAR):
            for j in range(0, BLOCK, FAR):
                y, x = r + i + FAR // 2, c + j + FAR // 2
                for k in range(3):
                    edges += _difference(raw, light, r + i, c + j, 1, k) ** 2
                    edges -= _difference(raw, light, y, x, 1, k) ** 2
        for i in range(FAR):
            for j in range(FAR):
                for k in range(3):
                    # At the same place of a compressed image's blocks: their edges cancel.
                    tile[i, 4 * j + k] = _difference(raw, light, r + 1 + i, c + 1 + j, FAR, k)
                tile[i, 4 * j + 3] = tile[i, 4 * j] - tile[i, 4 * j + 1]
        sums[:] = np.float32(0.0)
        for i in range(FAR):
            for m in range(4 * FAR):
                sums[FAR_APART, m] += tile[i, m] ** 2
        for i in range(FAR - 1):
            for m in range(4 * (FAR - 1)):
                one, right = tile[i, m], tile[i, m + 4]
                below, last = tile[i + 1, m], tile[i + 1, m + 4]
                sums[NEAR, m] += ((one - right) - (below - last)) ** 2
                sums[COARSE, m] += ((one + right) + (below + last)) ** 2
        for s in range(3):
            channels, colour = np.float32(0.0), np.float32(0.0)
            for j in range(FAR):
                channels += sums[s, 4 * j] + sums[s, 4 * j + 1] + sums[s, 4 * j + 2]
                colour += sums[s, 4 * j + 3]
            number = pixels if s == FAR_APART else cells
            variances[b, s] = channels / (np.float32(3.0) * number)
            if s == NEAR:
                variances[b, COLOUR_NEAR] = colour / (np.float32(2.0) * number)
            if s == COARSE:
                variances[b, COLOUR_COARSE] = colour / (np.float32(2.0) * number)
        variances[b, EDGES] = edges / np.float32(4 * 3 * 4)


def level_step(raw: NDArray[Any]) -> float:
    """Return the usual step between the numbers that an image uses, in levels of 8 bits.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image.
    """
    rows, columns = (max(size // LEVEL_SAMPLES, 1) for size in raw.shape[:2])
    # Green has the finest steps where a camera gives its channels different ones.
    green = raw[::rows, ::columns, 1].ravel()
    steps = np.diff(np.flatnonzero(np.bincount(green)))
    return float(np.median(steps)) * 255.0 / np.iinfo(raw.dtype).max if steps.size else 0.0
