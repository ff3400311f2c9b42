"""Press over background in a region, at the scale of the solve and at the coarsest scale."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve

from gelpolight_core.arrays import Map
from gelpolight_core.image.coded import LightLevels
from gelpolight_core.masks import SATURATED
from gelpolight_core.optics.pose import MOST_LENS_BLUR_PX
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.height_map import COARSE
from gelpolight_core.reconstruction.near_light.denoise import CALM, quieted
from gelpolight_core.reconstruction.near_light.maps import SensorMaps
from gelpolight_core.reconstruction.near_light.sampling import BEYOND_FINITE, halve, sample_rows
from gelpolight_core.reconstruction.near_light.structures import RatioImage, Region
from gelpolight_core.reconstruction.terms import Terms
from gelpolight_core.reconstruction.threads import RowWorkers

Gain = NDArray[np.float64]
Rows = tuple[tuple[np.float32, ...], ...]
HALVING = 0.25
"""What the average over two nodes along each axis adds to the square of a blur, in these nodes."""


class Compared(NamedTuple):
    """A region of an image beside the background.

    Attributes
    ----------
    fine, coarse : RatioImage
        At the scale of the solve, and at the coarsest scale.
    edge : (rows, columns) float32 or None
        How far denoising left the fine image as it is, 0..1; None where it was not denoised.
    kernel : (5, 5) float32 or None
        What undid the blur of the fine image; None where it was left.
    """

    fine: RatioImage
    coarse: RatioImage
    edge: Map | None
    kernel: Map | None = None


class PressSampler:
    """Compares raw images with the background.

    Parameters
    ----------
    maps : SensorMaps
        The sensor's.
    workers : RowWorkers
        Threads.
    buffers : Buffers
        Memory for its results, used again for each frame.
    """

    def __init__(self, maps: SensorMaps, workers: RowWorkers, buffers: Buffers) -> None:
        self.maps = maps
        self._workers = workers
        self._take = buffers.take
        self._inverse = np.linalg.inv(maps.calibration.crosstalk)
        self._unmix = _as_rows(self._inverse)
        # Without a stated blur: that of a sharp lens (0.37) and a pixel's own width (0.29).
        lens_px = min(maps.calibration.lens_blur_px or 0.47, MOST_LENS_BLUR_PX)
        # Bilinear sampling on the grid, whose nodes are a pixel apart, adds a sixth to its square.
        self._blur2 = lens_px**2 + 1.0 / 6.0
        self.levels = LightLevels(maps.calibration.response)

    def compare(
        self,
        raw: NDArray[Any],
        region: Region,
        *,
        factor: int,
        linear: bool,
        terms: Terms,
        gain: Gain | None = None,
    ) -> Compared:
        """Return press over background.

        Parameters
        ----------
        raw : (height, width, 3) uint8 or uint16
            Raw image; `MISSING` stands for what is not finite in a linear one.
        region : Region
            Where.
        factor : int
            Nodes of the grid to a node of the fine scale: 1, 2 or 4.
        linear : bool
            Whether its numbers are linear light, whatever the camera's response.
        terms : Terms
            What is left out.
        gain : (3,), optional
            Light of each channel over that at calibration.
        """
        # At scale 4 the image is read at scale 2: a node there sees 2 x 2 pixels.
        at = min(factor, 2)
        unmix = self._unmix if gain is None else _as_rows(self._inverse / gain)
        sampled = self._sampled(raw, region, at, linear, terms, unmix)
        edge = None
        if terms.denoising and (factor == 1 or (factor == 2 and self._noisy)):
            edge = quieted(sampled, self._noise(at), self._workers, self._take)
        kernel = None
        if terms.sharpening:
            blur2 = self._blur2 if at == 1 else self._blur2 + HALVING
            kernel = inverse_of_blur(blur2 / at**2)
            self._sharpen(sampled, region, kernel, edge)
        coarse = sampled
        while at < COARSE:
            at *= 2
            coarse = self._halved(coarse, f"at {at}")
            if terms.sharpening:
                self._sharpen(coarse, region, inverse_of_blur(HALVING / 4.0))
        fine = coarse if factor == COARSE else sampled
        if self.maps.membrane.interreflection > 0.0:
            coarse = self._as_if_flat(coarse, region, "coarse")
            fine = self._as_if_flat(fine, region, "fine")
        return Compared(fine, coarse, edge, kernel)

    def _sharpen(
        self, image: RatioImage, region: Region, kernel: Map, edge: Map | None = None
    ) -> None:
        """Remove the blur of an image with a kernel of :func:`inverse_of_blur`.

        Where a wall meets a face, blur makes the wall flatter, as brightness is not a linear
        function of slope; balls have no such edges, and do not show it. Noise grows with it, where
        `edge` says that it was not averaged.
        """
        factor = COARSE * region.shape[0] // len(image.marks)
        (top, left), (rows, columns) = region.at(COARSE // factor)
        kind = self.maps.scale(factor).kind[top : top + rows, left : left + columns]
        # A missing or saturated pixel says nothing of its neighbours' curvature.
        usable = ((kind == 2) & (image.marks == 0)).astype(np.uint8)
        inner = cv2.erode(usable, np.ones(kernel.shape, np.uint8), borderValue=0)
        mask = inner.astype(np.bool_)

        def sharpen(first: int, last: int) -> None:
            for ratio in image.ratio[first:last]:
                sharp = cv2.filter2D(ratio, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
                np.copyto(ratio, np.maximum(sharp, 0.0, out=sharp), where=mask)

        self._workers.run(len(image.ratio), sharpen)
        more = np.linalg.norm(kernel) - np.float32(1.0)
        noise = image.noise
        noise *= 1.0 + more * (inner if edge is None else inner * edge)

    def _noise(self, factor: int) -> tuple[np.float32, ...]:
        """Return the noise of press minus background; a node averages `factor` pixels squared."""
        sd = self.maps.calibration.noise / np.sqrt(2.0) / factor
        return tuple(np.float32(s) for s in sd)

    @cached_property
    def _noisy(self) -> bool:
        """Whether averages over 2 x 2 pixels are noisy at the darker end of the background."""
        light = self.maps.full.background[self.maps.usable][::64]
        dark = np.percentile(light, 10.0, axis=0) if len(light) else np.ones(3)
        return bool((np.array(self._noise(2)) > CALM * dark).any())

    def _image(self, shape: tuple[int, int], name: str) -> RatioImage:
        planes = [self._take(f"{part} {name}", (3, *shape)) for part in ("ratio", "noise")]
        marks = self._take(f"marks {name}", shape, np.uint8)
        return RatioImage(planes[0], planes[1], np.zeros((3, 1, 1), np.float32), marks)

    def _sampled(
        self,
        raw: NDArray[Any],
        region: Region,
        factor: int,
        linear: bool,
        terms: Terms,
        unmix: Rows,
    ) -> RatioImage:
        corner, shape = region.at(COARSE // factor)
        image = self._image(shape, "sampled")
        self._workers.run(
            shape[0],
            sample_rows,
            raw,
            self.levels(raw.dtype, linear),
            np.float32(SATURATED) if terms.saturation else BEYOND_FINITE,
            self.maps.source(factor),
            factor > 1,
            (unmix, self._noise(factor)),
            self.maps.scale(factor).kind,
            corner,
            image,
        )
        return image

    def _halved(self, fine: RatioImage, name: str) -> RatioImage:
        rows, columns = fine.marks.shape
        coarse = self._image((rows // 2, columns // 2), name)
        self._workers.run(rows // 2, halve, fine, coarse)
        return coarse

    def _as_if_flat(self, image: RatioImage, region: Region, name: str) -> RatioImage:
        """Return an image with the light that a flat membrane receives from around."""
        (top, left), (rows, columns) = region.at(1)
        around = self._take(f"around {name}", image.ratio.shape)
        for k in range(3):
            share = self.maps.returned[k, top : top + rows, left : left + columns]
            cv2.resize(share, image.marks.shape[::-1], around[k])
        return image._replace(around=around)


def inverse_of_blur(blur2: float) -> Map:
    """Return the kernel (5, 5) that removes a blur of given squared width, to second order.

    A Gaussian blur is the exponential of half its square times the Laplacian; this is the
    exponential of the opposite.
    """
    across = np.array([[0.0, 1.0, 0.0], [1.0, -4.0, 1.0], [0.0, 1.0, 0.0]])
    first, share = np.pad(across, 1), 0.5 * blur2
    second = convolve(first, across, mode="constant")
    kernel = -share * first + 0.5 * share**2 * second
    kernel[2, 2] += 1.0
    return np.asarray(kernel, np.float32)


def _as_rows(matrix: NDArray[np.floating]) -> Rows:
    return tuple(tuple(row) for row in matrix.astype(np.float32))
