"""Resample an image to press over background, at the scale of the solve and at the coarsest."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.image.coded import LightLevels
from gelpolight_core.reconstruction.buffers import BufferPool
from gelpolight_core.reconstruction.compiled import HALF, ONE, ZERO, part, single, whole
from gelpolight_core.reconstruction.height_map import COARSE
from gelpolight_core.stages.checkerboards.top_surface_pose import MOST_LENS_BLUR_PX

from .denoise import CALM, denoise_ratio
from .kernel_structures import NOT_FINITE, GridRegion, RatioImage
from .sensor_maps import SensorMaps

BEYOND_FINITE = single(1.5)
_UNKNOWN_NOISE = single(1e6)
HALVING = 0.25
"""Squared blur that an average over two nodes adds along each axis, in units of these nodes."""


class RawFrame(NamedTuple):
    """A raw image (height, width, 3) in whole numbers.

    `linear` says whether they are linear light; `gain` is the light of each channel (3,) over that
    at calibration, None: the same. `blended` is the share of the frame before.
    """

    raw: NDArray[Any]
    linear: bool
    gain: Float64Array | None = None
    blended: float = 0.0


class RatioPyramid(NamedTuple):
    """Press over background in a region, at two scales.

    Attributes
    ----------
    fine, coarse : RatioImage
        At the scale of the solve, and at the coarsest scale.
    edge : (rows, columns) float32 or None
        Fraction of its own value that denoising left each fine node, 0..1. None: not denoised.
    kernel : (5, 5) float32
        Filter that sharpened the fine image.
    """

    fine: RatioImage
    coarse: RatioImage
    edge: Float32Array | None
    kernel: Float32Array


class RatioSampler:
    """Samples press over background from raw images.

    Parameters
    ----------
    maps : SensorMaps
        Precomputed calibration data.
    workers : RowThreadPool
        Threads for blocks of rows.
    buffers : BufferPool
        Memory for the results, used again for each frame.
    """

    def __init__(self, maps: SensorMaps, workers: RowThreadPool, buffers: BufferPool) -> None:
        self.maps = maps
        self._workers = workers
        self._take = buffers.take
        self._unmix = np.linalg.inv(maps.calibration.crosstalk)
        self.levels = LightLevels(maps.calibration.response)

    def compare(self, image: RawFrame, region: GridRegion, factor: int) -> RatioPyramid:
        """Return press over background, denoised and sharpened.

        Parameters
        ----------
        image : RawFrame
            Raw image; `MISSING` marks what is not finite in a linear one.
        region : GridRegion
            Nodes to sample.
        factor : int
            Nodes of the grid to a node of the fine scale: 1, 2 or 4.
        """
        # At scale 4 the image is read at scale 2: a node there sees 2 x 2 pixels.
        scale = min(factor, 2)
        sampled = self._sampled(image, region, scale)
        edge = None
        if factor == 1 or (factor == 2 and self._noisy):
            edge = denoise_ratio(sampled, self._noise(scale), self._workers, self._take)
        kernel = inverse_of_blur(removed_blur2(self.maps.calibration.lens_blur_px, scale))
        self._sharpen(sampled, region, kernel, edge)
        coarse = sampled
        while scale < COARSE:
            scale *= 2
            fine = coarse
            coarse = self._image(region.at(COARSE // scale)[1], f"at {scale}")
            self._workers.run(len(coarse.marks), halve, fine, coarse)
            self._sharpen(coarse, region, inverse_of_blur(HALVING / 4.0))
        fine = coarse if factor == COARSE else sampled
        if self.maps.membrane.interreflection > 0.0:
            coarse = self._as_if_flat(coarse, region)
        return RatioPyramid(fine, coarse, edge, kernel)

    def _sampled(self, image: RawFrame, region: GridRegion, factor: int) -> RatioImage:
        corner, shape = region.at(COARSE // factor)
        ratio_image = self._image(shape, "sampled")
        unmix = self._unmix if image.gain is None else self._unmix / image.gain
        self._workers.run(
            shape[0],
            sample_rows,
            image.raw,
            self.levels(image.raw.dtype, image.linear),
            np.float32(SATURATED),
            self.maps.source(factor),
            factor > 1,
            (tuple(map(tuple, unmix.astype(np.float32))), self._noise(factor)),
            self.maps.scale(factor).kind,
            corner,
            ratio_image,
        )
        return ratio_image

    def _image(self, shape: tuple[int, int], name: str) -> RatioImage:
        planes = [self._take(f"{part} {name}", (3, *shape)) for part in ("ratio", "noise")]
        marks = self._take(f"marks {name}", shape, np.uint8)
        return RatioImage(planes[0], planes[1], np.zeros((12, 1, 1), np.float32), marks)

    def _sharpen(
        self,
        image: RatioImage,
        region: GridRegion,
        kernel: Float32Array,
        edge: Float32Array | None = None,
    ) -> None:
        """Remove the blur of an image with a kernel of :func:`inverse_of_blur`.

        Where a wall meets a face, blur makes the wall flatter, as brightness is not a linear
        function of slope. Balls have no such edges, and do not show it. Noise grows with it, where
        `edge` says that it was not averaged.
        """
        factor = COARSE * region.shape[0] // len(image.marks)
        kind = self.maps.scale(factor).kind[region.window(COARSE // factor)]
        # A missing or saturated pixel says nothing of its neighbours' curvature.
        usable = ((kind == 2) & (image.marks == 0)).astype(np.uint8)
        inner = cv2.erode(usable, np.ones(kernel.shape, np.uint8), borderValue=0)
        mask = inner.astype(np.bool_)

        def sharpen(first: int, last: int) -> None:
            for ratio in image.ratio[first:last]:
                sharp = cv2.filter2D(ratio, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
                # Below 0, too: noise in shadows would otherwise be light.
                np.copyto(ratio, sharp, where=mask)

        self._workers.run(len(image.ratio), sharpen)
        more = np.linalg.norm(kernel) - np.float32(1.0)
        noise = image.noise
        noise *= 1.0 + more * (inner if edge is None else inner * edge)

    def _noise(self, factor: int) -> tuple[np.float32, ...]:
        """Return the noise of press minus background at nodes of `factor` pixels squared."""
        sd = self.maps.calibration.noise / np.sqrt(2.0) / factor
        return tuple(np.float32(s) for s in sd)

    @cached_property
    def _noisy(self) -> bool:
        """Whether averages over 2 x 2 pixels are noisy at the darker end of the background."""
        light = self.maps.full.background[self.maps.usable][::64]
        dark = np.percentile(light, 10.0, axis=0) if len(light) else np.ones(3)
        return bool((np.array(self._noise(2)) > CALM * dark).any())

    def _as_if_flat(self, image: RatioImage, region: GridRegion) -> RatioImage:
        """Return a coarse image with the interreflected light of a flat membrane."""
        around = np.zeros((12, *image.marks.shape), np.float32)
        around[:3] = self.maps.returned[(slice(None), *region.window(1))]
        return image._replace(around=around)


def removed_blur2(lens_px: float | None, scale: int) -> float:
    """Return the squared blur of an image that is removed, in squared nodes of 1 or 2 pixels.

    Without a blur of the lens it is that of a sharp one (0.37) and a pixel's own width (0.29).
    """
    # Bilinear sampling on the grid, whose nodes are a pixel apart, adds a sixth to its square.
    blur2 = min(lens_px or 0.47, MOST_LENS_BLUR_PX) ** 2 + 1.0 / 6.0
    return (blur2 if scale == 1 else blur2 + HALVING) / scale**2


def inverse_of_blur(blur2: float) -> Float32Array:
    """Return the kernel (5, 5) that removes a blur of given squared width, to second order.

    A Gaussian blur is the exponential of half its square times the Laplacian. This kernel is the
    exponential of the opposite.
    """
    laplacian = np.array([[0.0, 1.0, 0.0], [1.0, -4.0, 1.0], [0.0, 1.0, 0.0]])
    padded = np.pad(laplacian, 1)
    half_blur2 = 0.5 * blur2
    kernel = -half_blur2 * padded
    kernel += 0.5 * half_blur2**2 * convolve(padded, laplacian, mode="constant")
    kernel[2, 2] += 1.0
    return np.asarray(kernel, np.float32)


@part
def _near(light, raw, k, c, r, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the bilinear light among four pixels, and the brightest of them."""
    p00, p01 = light[k, raw[r, c, k]], light[k, raw[r, c + 1, k]]
    p10, p11 = light[k, raw[r + 1, c, k]], light[k, raw[r + 1, c + 1, k]]
    upper, lower = p00 + fu * (p01 - p00), p10 + fu * (p11 - p10)
    return upper + fv * (lower - upper), max(max(p00, p01), max(p10, p11))


@part
def _wide(light, raw, k, c, r, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the bilinear light between averages of 2 x 2 pixels, and the brightest pixel."""
    c1, r1 = c + 1, r + 1
    c2, r2 = min(c + 2, raw.shape[1] - 1), min(r + 2, raw.shape[0] - 1)
    p00, p01, p02 = light[k, raw[r, c, k]], light[k, raw[r, c1, k]], light[k, raw[r, c2, k]]
    p10, p11, p12 = light[k, raw[r1, c, k]], light[k, raw[r1, c1, k]], light[k, raw[r1, c2, k]]
    p20, p21, p22 = light[k, raw[r2, c, k]], light[k, raw[r2, c1, k]], light[k, raw[r2, c2, k]]
    top = max(max(max(p00, p01), max(p02, p10)), max(max(p11, p12), max(p20, p21)))
    a, b = ONE - fu, ONE - fv
    mean = single(0.25) * (
        b * (a * p00 + p01 + fu * p02)
        + (a * p10 + p11 + fu * p12)
        + fv * (a * p20 + p21 + fu * p22)
    )
    return mean, max(top, p22)


@whole
def sample_rows(first, last, raw, light, limit, source, wide, sensor, kind, corner, image):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Compare a raw image with the background, rows `first` to `last` of a region.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image.
    light : (3, levels) float32
        Linear light of every number.
    limit : float
        Light from which on a channel is saturated.
    source : tuple
        Raw pixel (u, v) and background (..., 3) of each node of the whole grid.
    wide : bool
        Whether a node is seen over 2 x 2 pixels; else bilinear among four.
    sensor : tuple
        Rows of the matrix that removes crosstalk, and the noise of press minus background (3).
    kind : (rows, columns) uint8
        `PyramidLevel.kind` of the whole grid.
    corner : tuple
        Row and column of the region's first node.
    image : RatioImage
        Ratio, noise and marks are written.
    """
    u_px, v_px, background = source
    unmix, sd = sensor
    ratio, noise, marks = image.ratio, image.noise, image.marks
    height, width = raw.shape[0], raw.shape[1]
    back = HALF if wide else ZERO
    measured = np.empty(3, np.float32)
    for i in range(first, last):
        at = i + corner[0]
        for j in range(ratio.shape[2]):
            to = j + corner[1]
            if kind[at, to] != 2:
                for k in range(3):
                    ratio[k, i, j], noise[k, i, j] = ONE, _UNKNOWN_NOISE
                marks[i, j] = 0
                continue
            u = min(max(u_px[at, to] - back, ZERO), single(width - 1.001))
            v = min(max(v_px[at, to] - back, ZERO), single(height - 1.001))
            c, r = min(int(u), width - 2), min(int(v), height - 2)
            fu, fv = u - single(c), v - single(r)
            bits = 0
            for k in range(3):
                if wide:
                    measured[k], top = _wide(light, raw, k, c, r, fu, fv)
                else:
                    measured[k], top = _near(light, raw, k, c, r, fu, fv)
                if top >= limit:
                    bits |= 1 << k
                    if top > BEYOND_FINITE:
                        bits |= NOT_FINITE
            for k in range(3):
                row = unmix[k]
                light_k = row[0] * measured[0] + row[1] * measured[1] + row[2] * measured[2]
                gain = ONE / background[at, to, k]
                ratio[k, i, j] = light_k * gain
                noise[k, i, j] = sd[k] * gain
            marks[i, j] = bits


@part
def _finite_mean(fine, coarse, i, j):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the mean ratio of four nodes without those that are not finite, or 1."""
    count = 0
    for r in range(2 * i, 2 * i + 2):
        for c in range(2 * j, 2 * j + 2):
            count += not fine.marks[r, c] & NOT_FINITE
    for k in range(3):
        total = ZERO
        for r in range(2 * i, 2 * i + 2):
            for c in range(2 * j, 2 * j + 2):
                if not fine.marks[r, c] & NOT_FINITE:
                    total += fine.ratio[k, r, c]
        coarse.ratio[k, i, j] = total / single(count) if count else ONE


@whole
def halve(first, last, fine, coarse):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average an image over 2 x 2 nodes, without those that are not finite.

    A channel is saturated where most of the nodes are.
    """
    columns = coarse.marks.shape[1]
    quarter, eighth = single(0.25), single(0.125)
    for i in range(first, last):
        for k in range(3):
            a, b, out = fine.ratio[k, 2 * i], fine.ratio[k, 2 * i + 1], coarse.ratio[k, i]
            for j in range(columns):
                out[j] = quarter * ((a[2 * j] + a[2 * j + 1]) + (b[2 * j] + b[2 * j + 1]))
            a, b, out = fine.noise[k, 2 * i], fine.noise[k, 2 * i + 1], coarse.noise[k, i]
            for j in range(columns):
                out[j] = eighth * ((a[2 * j] + a[2 * j + 1]) + (b[2 * j] + b[2 * j + 1]))
        up, low, marks = fine.marks[2 * i], fine.marks[2 * i + 1], coarse.marks[i]
        for j in range(columns):
            p, q, r, s = up[2 * j], up[2 * j + 1], low[2 * j], low[2 * j + 1]
            marks[j] = (p & q & r) | (p & q & s) | (p & r & s) | (q & r & s)
            if (p | q | r | s) & NOT_FINITE:
                _finite_mean(fine, coarse, i, j)
