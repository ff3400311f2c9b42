"""Where an image differs from the background: found on blocks of raw pixels, before any solve.

A deep contact changes the light of single blocks. A shallow one changes it by less than a block's
noise, but over the whole width of its drape: averages over wider areas show it. The smallest depth
that is found this way is stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.membrane_masks import (
    CONTACT_CHANGE,
    CONTACT_SIGMAS,
    LEAST_LIGHT,
    SATURATED,
    lit_mask,
)
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.geometry.refraction import camera_to_membrane
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.reconstruction.compiled import single, whole
from gelpolight_core.sensor.sensor_calibration import FullModel, OpenSensor

from .kernel_structures import GridRegion, PyramidLevel

# A press changes the light from the surroundings too, far from itself and without any slope.
CHANGE_BY_INTERREFLECTION = 6e-3
MARGIN_DECAYS = 1.5
"""Margin of the region around a contact; the drape falls by a factor e over its decay length."""
LEAST_MARGIN_MM = 0.8
AREAS_MM = (0.6, 1.4)
"""Widths of the areas over which a shallow contact is looked for: the drape's, and twice that."""
AREA_CHANGE = 2.5e-3
"""Change of the light of an area, minus that of the whole field, that does not count as a contact:
LEDs that warm up unevenly cause as much."""
AREA_SIGMAS = 6.0
"""With half a million areas, noise alone causes a contact in less than one of a thousand images."""
FILLED_CHANGE = 0.05
"""Change of a channel that does not count where the background may be saturated: its light there is
filled in from the model and the surroundings."""
STATED_NOISE = 1.4
"""A calibration states the noise of resampled images; raw pixels have as many times more."""
VISIBLE_PERCENT = 90.0
"""The smallest visible depth is valid for this share of the field."""
# Raw pixels between the places at which the optics is followed.
STRIDE = 8
# Blocks between those from which the field's median is taken.
THIN = 3


@dataclass(frozen=True, slots=True)
class ContactBox:
    """The part of the membrane that differs from the background.

    Attributes
    ----------
    low, high : tuple of 2 floats
        Corners (x, y) in the sensor frame, mm, without a margin.
    share : float
        Fraction of blocks that differ.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    share: float


@dataclass(frozen=True, slots=True)
class BlockAverageFilter:
    """Averages over squares of blocks, in which shallow contacts are looked for.

    Attributes
    ----------
    blocks : int
        Along a side; odd.
    per_limit : (rows, columns, 3) float32
        One over the share of the light that counts; 0 where the background is not known.
    """

    blocks: int
    per_limit: Float32Array


@dataclass(frozen=True, slots=True)
class ContactFinder:
    """Detects contacts by the background in blocks of raw pixels.

    Attributes
    ----------
    block : int
        Raw pixels along a side.
    expected : (rows, columns, 3) float32
        Mean of the block without contact, as the camera gives it, 0..1.
    limit : (rows, columns, 3) float32
        Change that counts; infinite where the background is not known.
    per_light, most : (rows, columns, 3) float32
        One over `expected`, and the largest share that a block adds to an area; 0 where the
        background is not known.
    thin : (blocks,) int
        Indices of some known blocks all over the field, for medians.
    points_mm : (rows, columns, 2) float64
        Place on the membrane.
    areas : tuple of BlockAverageFilter
        For shallow contacts.
    beside_mm : float
        Distance from a deep contact at which a shallow one is separate; closer, it is drape.
    visible_mm : float
        Smallest depth of a flat face that is found over most of the field; smaller relief is taken
        for noise.
    response : CameraResponse or None
        How the camera encodes light; None: linearly.
    """

    block: int
    expected: Float32Array
    limit: Float32Array
    per_light: Float32Array
    most: Float32Array
    thin: NDArray[np.intp]
    points_mm: NDArray[np.float64]
    areas: tuple[BlockAverageFilter, ...]
    beside_mm: float
    visible_mm: float
    response: CameraResponse | None

    def find(
        self, frame: NDArray[Any], workers: RowThreadPool, gain: NDArray[np.float64] | None = None
    ) -> ContactBox | None:
        """Return where a raw frame differs, or None where it does nowhere.

        Parameters
        ----------
        frame : (height, width, 3)
            Raw image.
        workers : RowThreadPool
            Threads for blocks of rows.
        gain : (3,), optional
            Light of each channel over that at calibration.
        """
        change = means(frame, self.block, workers) - self._expected(gain)
        contact_mask = _among_others(_in_any(np.abs(change) > self.limit))
        shallow = self._shallow(change)
        if shallow is not None and contact_mask.any():
            low, high = _corners(self.points_mm[contact_mask])
            points = self.points_mm[shallow]
            distance_mm = np.maximum(low - points, points - high).max(axis=1)
            shallow[shallow] = distance_mm > self.beside_mm
        contact_mask = contact_mask if shallow is None else contact_mask | shallow
        if not contact_mask.any():
            return None
        low, high = _corners(self.points_mm[contact_mask])
        known_count = np.isfinite(self.limit[..., 0]).sum()
        return ContactBox(
            (float(low[0]), float(low[1])),
            (float(high[0]), float(high[1])),
            float(np.count_nonzero(contact_mask) / max(known_count, 1)),
        )

    def _expected(self, gain: NDArray[np.float64] | None) -> Float32Array:
        if gain is None:
            return self.expected
        if self.response is None:
            return np.asarray(self.expected * gain, np.float32)
        light = np.empty_like(self.expected)
        for k, curve in enumerate(self.response.curves):
            levels = np.linspace(0.0, 1.0, curve.size)
            light[..., k] = gain[k] * np.interp(self.expected[..., k], levels, curve)
        return _encoded(light, self.response)

    def _shallow(self, change: Float32Array) -> BoolArray | None:
        """Return where averages over areas (rows, columns) differ, or None where none does."""
        if not self.thin.size:
            return None
        share = change * self.per_light
        # No single block decides: a hot pixel or a speck counts as much as the noise may.
        np.minimum(share, self.most, out=share)
        np.maximum(share, -self.most, out=share)
        # The LEDs' common change is no contact. Whole rows: numpy is slow along an axis of three.
        common, lines = (
            np.median(share.reshape(-1, 3)[self.thin], axis=0),
            share.reshape(len(share), -1),
        )
        lines -= np.tile(common, share.shape[1]) * (self.per_light > 0.0).reshape(lines.shape)
        mask = None
        for area in self.areas:
            side = (area.blocks, area.blocks)
            z = np.abs(cv2.blur(share, side, borderType=cv2.BORDER_CONSTANT)) * area.per_limit
            if z.max() <= 1.0:
                continue
            # An image with more noise than the calibration states has its own limit.
            # Median size of normal noise, in standard deviations.
            typical_size = float(np.median(z.reshape(-1, 3)[self.thin])) / 0.6745
            differs = z > max(typical_size * AREA_SIGMAS, 1.0)
            if differs.any():
                mask = _in_any(differs) if mask is None else mask | _in_any(differs)
        return None if mask is None else _among_others(mask)


def _among_others(blocks: BoolArray) -> BoolArray:
    """Return where three of the nine blocks about one are true: a hot pixel is no contact."""
    count = blocks.astype(np.uint8)
    cv2.boxFilter(count, -1, (3, 3), count, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(count >= 3)


def _in_any(channels: BoolArray) -> BoolArray:
    """Return where one of three channels (rows, columns, 3) is true."""
    return np.asarray(channels[..., 0] | channels[..., 1] | channels[..., 2])


def _corners(points_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of the rectangle around points (N, 2)."""
    return points_mm.min(axis=0), points_mm.max(axis=0)


def margin_mm(full: FullModel) -> float:
    """Return the margin of the region around a contact."""
    return max(MARGIN_DECAYS * full.decay_mm, LEAST_MARGIN_MM)


def contact_finder(calibration: OpenSensor, full: FullModel) -> ContactFinder:
    """Bring a calibration's background into the camera's image, in blocks."""
    camera, table = calibration.camera, calibration.table
    grid = table.grid
    block = max(round(0.2 / grid.pitch_mm), 1)
    positions = _points(calibration)
    u, v = (
        np.arange(n, dtype=np.float32) / np.float32(STRIDE) for n in (camera.width, camera.height)
    )
    map_u, map_v = np.meshgrid(u, v)
    points: Float32Array = np.asarray(
        cv2.remap(positions.astype(np.float32), map_u, map_v, cv2.INTER_LINEAR), np.float32
    )
    origin = np.array([grid.x_mm[0], grid.y_mm[0]])
    index = ((points - origin) / grid.pitch_mm).astype(np.float32)
    valid_mask = table.valid & lit_mask(full.background)

    def seen(values: NDArray[Any]) -> Float32Array:
        return np.asarray(
            cv2.remap(
                np.asarray(values, np.float32),
                np.ascontiguousarray(index[..., 0]),
                np.ascontiguousarray(index[..., 1]),
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_CONSTANT,
            )
        )

    light = seen(full.background) @ calibration.crosstalk.T.astype(np.float32)
    image = _encoded(np.minimum(light, np.float32(1.0)), calibration.response)
    rows, columns = camera.height // block, camera.width // block

    def blocks(values: Float32Array) -> Float32Array:
        cut = np.ascontiguousarray(values[: rows * block, : columns * block])
        return np.asarray(cv2.resize(cut, (columns, rows), interpolation=cv2.INTER_AREA))

    expected = blocks(image)
    # The background was resampled: places that depend on the blur are not reliable.
    blurred = cv2.GaussianBlur(image, (0, 0), 1.0)
    unsure = np.abs(blocks(np.asarray(blurred, np.float32)) - expected)
    least = CONTACT_CHANGE + CHANGE_BY_INTERREFLECTION * full.membrane.interreflection
    core = cv2.erode(valid_mask.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0)
    inside = blocks(seen(core)) > 0.999
    # Stated at the median brightness; it grows with the light, and the background has its own.
    median = np.median(expected[inside], axis=0) if inside.any() else np.ones(3)
    noise = calibration.noise * np.sqrt(2.0 * np.maximum(expected / median, 1.0))
    full_scale = blocks((image > SATURATED - FILLED_CHANGE).astype(np.float32)) > 0.0
    filled = FILLED_CHANGE * cv2.dilate(full_scale.astype(np.float32), np.ones((3, 3), np.uint8))
    limit = np.maximum(least * expected, CONTACT_SIGMAS / block * noise) + 2.0 * unsure
    limit += filled * expected
    per_light = np.where(inside[..., None], 1.0 / np.maximum(expected, LEAST_LIGHT), 0.0)
    most = (limit * per_light).astype(np.float32)
    limit[~inside] = np.inf
    middle = blocks(points).astype(np.float64)
    side_mm = block * grid.pitch_mm
    areas = []
    for width_mm in AREAS_MM:
        side = 2 * round(0.5 * (width_mm / side_mm - 1.0)) + 1
        # The darkest part of an area is its noisiest.
        variance = np.maximum(cv2.blur((noise * per_light) ** 2, (side, side)), 0.0)
        change = AREA_CHANGE + CHANGE_BY_INTERREFLECTION * full.membrane.interreflection
        share = np.maximum(change, AREA_SIGMAS / (block * side) * np.sqrt(variance))
        share += 2.0 / side * unsure * per_light + cv2.blur(filled, (side, side))
        per_limit = np.where(inside[..., None], 1.0 / share, 0.0)
        areas.append(BlockAverageFilter(side, per_limit.astype(np.float32)))
    spread = np.zeros_like(inside)
    spread[::THIN, ::THIN] = inside[::THIN, ::THIN]
    return ContactFinder(
        block,
        expected,
        limit.astype(np.float32),
        per_light.astype(np.float32),
        most,
        np.flatnonzero(spread),
        middle,
        tuple(areas),
        2.0 * margin_mm(full),
        _visible_mm(full, middle, areas, side_mm),
        calibration.response,
    )


def _visible_mm(
    full: FullModel, points_mm: NDArray[np.float64], areas: list[BlockAverageFilter], side_mm: float
) -> float:
    """Return the depth of a flat face whose drape changes an area's light by the limit.

    The drape around a face d deep has the slope d / decay at the edge and falls by e over the
    decay length. A slope changes the light of a matt membrane by its product with the tangent of
    the light's angle from the vertical, where the membrane falls towards the light or away.
    """
    known_mask = (areas[0].per_limit > 0.0).all(axis=2)
    if not known_mask.any():
        return np.inf
    points = points_mm[known_mask][::THIN]
    led = full.led_positions_mm
    across = np.linalg.norm(led[:, :2] - points[:, None, :], axis=2)
    tangent = across / np.abs(led[:, 2])
    decay, depths_mm = full.decay_mm, []
    for area in areas:
        width = area.blocks * side_mm
        mean = decay / width * (1.0 - np.exp(-width / decay))
        slope = 1.0 / (area.per_limit[known_mask][::THIN] * np.maximum(tangent * mean, 1e-6))
        depths_mm.append(decay * slope.min(axis=1))
    return STATED_NOISE * float(np.percentile(np.min(depths_mm, axis=0), VISIBLE_PERCENT))


def means(frame: NDArray[Any], block: int, workers: RowThreadPool) -> Float32Array:
    """Return the means (rows, columns, 3) of blocks of a raw frame, 0..1 of its scale."""
    rows, columns = frame.shape[0] // block, frame.shape[1] // block
    result = np.empty((rows, columns, 3), np.float32)
    scale = np.float32(1.0 if frame.dtype.kind == "f" else 1.0 / np.iinfo(frame.dtype).max)
    flat = frame.reshape(frame.shape[0], -1)
    workers.run(rows, _block_means, flat, scale, block, result)
    return result


@whole
def _block_means(first, last, raw, scale, block, means):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average blocks of raw pixels, block rows `first` to `last`."""
    width = means.shape[1] * block * 3
    line = np.empty(width, np.float32)
    share = scale / single(block * block)
    for i in range(first, last):
        line[:] = 0.0
        for r in range(i * block, (i + 1) * block):
            source = raw[r]
            for c in range(width):
                line[c] += single(source[c])
        for j in range(means.shape[1]):
            at = 3 * block * j
            a, b, d = single(0.0), single(0.0), single(0.0)
            for c in range(block):
                a += line[at + 3 * c]
                b += line[at + 3 * c + 1]
                d += line[at + 3 * c + 2]
            means[i, j, 0], means[i, j, 1], means[i, j, 2] = a * share, b * share, d * share


def _points(calibration: OpenSensor) -> NDArray[np.float64]:
    """Return places on the membrane (rows, columns, 2) of every `STRIDE`-th raw pixel."""
    camera = calibration.camera
    u = np.arange(0, camera.width + STRIDE, STRIDE, dtype=np.float64)
    v = np.arange(0, camera.height + STRIDE, STRIDE, dtype=np.float64)
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    points, _ = camera_to_membrane(
        camera.directions(pixels), calibration.plane, calibration.stack, calibration.surface
    )
    return np.where(np.isfinite(points), points, 1e6)


def _encoded(light: Float32Array, response: CameraResponse | None) -> Float32Array:
    """Return linear light as the camera encodes it."""
    if response is None:
        return np.asarray(light, np.float32)
    encoded = np.empty_like(light)
    for k, curve in enumerate(response.curves):
        encoded[..., k] = np.interp(light[..., k], curve, np.linspace(0.0, 1.0, curve.size))
    return encoded


def padded_region(contact: ContactBox, scale: PyramidLevel, margin_mm: float) -> GridRegion:
    """Return a contact's region with a margin, its sides of lengths that the transform likes."""
    spans = []
    for axis in (1, 0):
        origin = (scale.x_mm, scale.y_mm)[axis]
        first = (contact.low[axis] - margin_mm - origin) / scale.pitch_mm
        last = (contact.high[axis] + margin_mm - origin) / scale.pitch_mm
        spans.append(_span(first, last, scale.kind.shape[1 - axis]))
    (top, rows), (left, columns) = spans
    return GridRegion((top, left), (rows, columns))


def _span(first: float, last: float, length: int) -> tuple[int, int]:
    """Return begin and count of a span of nodes about `first` to `last`, of a good length."""
    start, end = max(int(np.floor(first)), 0), min(int(np.ceil(last)) + 1, length)
    count = min(next_fast_len(max(end - start, 8), real=True), length)
    return min(max((start + end - count) // 2, 0), length - count), count
