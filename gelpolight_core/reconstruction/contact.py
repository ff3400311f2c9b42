"""Where a picture differs from the background: found on blocks of raw pixels, before any solve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.optics.refraction import camera_to_membrane
from gelpolight_core.reconstruction.full import LEAST_BASE
from gelpolight_core.reconstruction.live_pixels import block_means
from gelpolight_core.reconstruction.threads import RowWorkers

Map = NDArray[np.float32]
BLOCK_MM = 0.2
# Slopes that change the light by less are below half a degree, and fall off within the margin.
LEAST_CHANGE = 5e-3
# A press changes the light from the surroundings too, far from itself and without any slope.
CHANGE_BY_BOUNCE = 6e-3
SIGMAS = 5.0
# Of the nine blocks about one, so that a hot pixel is no contact.
NEIGHBOURS = 3
# Raw pixels between the places at which the optics is followed.
STRIDE = 8


@dataclass(frozen=True, slots=True)
class Contact:
    """The part of the membrane that differs from the background.

    Attributes
    ----------
    low, high : tuple of 2 floats
        Its corners (x, y) in the sensor frame, mm, without a margin.
    share : float
        Of the blocks that differ.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    share: float


@dataclass(frozen=True, slots=True)
class ContactFinder:
    """The background in blocks of raw pixels.

    Attributes
    ----------
    block : int
        Raw pixels along a side.
    expected : (rows, columns, 3) float32
        Mean of the block without contact, as the camera gives it, 0..1.
    limit : (rows, columns, 3) float32
        Change that counts; infinite where the background is not known.
    points_mm : (rows, columns, 2) float64
        Place on the membrane.
    """

    block: int
    expected: Map
    limit: Map
    points_mm: NDArray[np.float64]

    def find(self, frame: NDArray[Any], workers: RowWorkers) -> Contact | None:
        """Return where a raw frame (height, width, 3) differs, or None where it does nowhere."""
        changed = np.abs(means(frame, self.block, workers) - self.expected) > self.limit
        seen = changed.any(axis=2).astype(np.uint8)
        cv2.boxFilter(seen, -1, (3, 3), seen, normalize=False, borderType=cv2.BORDER_CONSTANT)
        rows, columns = np.nonzero(seen >= NEIGHBOURS)
        if rows.size == 0:
            return None
        points = self.points_mm[rows, columns]
        low, high = points.min(axis=0), points.max(axis=0)
        known = np.isfinite(self.limit[..., 0]).sum()
        return Contact(
            (float(low[0]), float(low[1])),
            (float(high[0]), float(high[1])),
            float(rows.size / max(known, 1)),
        )


def contact_finder(calibration: Calibration, full: FullModel) -> ContactFinder:
    """Bring a calibration's background into the camera's picture, in blocks."""
    camera, table = calibration.camera, calibration.table
    grid = table.grid
    block = max(round(BLOCK_MM / grid.pitch_mm), 1)
    places = _points(calibration)
    u, v = (
        np.arange(n, dtype=np.float32) / np.float32(STRIDE) for n in (camera.width, camera.height)
    )
    map_u, map_v = np.meshgrid(u, v)
    points: Map = np.asarray(
        cv2.remap(places.astype(np.float32), map_u, map_v, cv2.INTER_LINEAR), np.float32
    )
    origin = np.array([grid.x_mm[0], grid.y_mm[0]])
    index = ((points - origin) / grid.pitch_mm).astype(np.float32)
    known = table.valid & (full.background > LEAST_BASE).all(axis=2)

    def seen(values: NDArray[Any]) -> Map:
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
    picture = _encoded(light, calibration)
    rows, columns = camera.height // block, camera.width // block

    def blocks(values: Map) -> Map:
        cut = np.ascontiguousarray(values[: rows * block, : columns * block])
        return np.asarray(cv2.resize(cut, (columns, rows), interpolation=cv2.INTER_AREA))

    expected = blocks(picture)
    # The background was resampled on its way here: what another blur changes is not to be trusted.
    blurred = cv2.GaussianBlur(picture, (0, 0), 1.0)
    unsure = np.abs(blocks(np.asarray(blurred, np.float32)) - expected)
    least = LEAST_CHANGE + CHANGE_BY_BOUNCE * full.membrane.bounce
    core = cv2.erode(known.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0)
    inside = blocks(seen(core)) > 0.999
    # Stated at the median brightness; it grows with the light, and the background has its own.
    median = np.median(expected[inside], axis=0) if inside.any() else np.ones(3)
    noise = calibration.noise * np.sqrt(2.0 * np.maximum(expected / median, 1.0))
    limit = np.maximum(least * expected, SIGMAS / block * noise) + 2.0 * unsure
    limit[~inside] = np.inf
    return ContactFinder(
        block, expected, limit.astype(np.float32), blocks(points).astype(np.float64)
    )


def means(frame: NDArray[Any], block: int, workers: RowWorkers) -> Map:
    """Return the means (rows, columns, 3) of blocks of a raw frame, 0..1 of its scale."""
    rows, columns = frame.shape[0] // block, frame.shape[1] // block
    result = np.empty((rows, columns, 3), np.float32)
    scale = np.float32(1.0 if frame.dtype.kind == "f" else 1.0 / np.iinfo(frame.dtype).max)
    flat = frame.reshape(frame.shape[0], -1)
    workers.run(rows, block_means, flat, scale, block, result)
    return result


def _points(calibration: Calibration) -> NDArray[np.float64]:
    """Return places on the membrane (rows, columns, 2) of every `STRIDE`-th raw pixel."""
    camera = calibration.camera
    u = np.arange(0, camera.width + STRIDE, STRIDE, dtype=np.float64)
    v = np.arange(0, camera.height + STRIDE, STRIDE, dtype=np.float64)
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    points, _ = camera_to_membrane(camera.directions(pixels), calibration.plane, calibration.stack)
    return np.where(np.isfinite(points), points, 1e6)


def _encoded(light: Map, calibration: Calibration) -> Map:
    """Return linear light as the camera encodes it."""
    if calibration.response is None:
        return np.asarray(light, np.float32)
    encoded = np.empty_like(light)
    for k, curve in enumerate(calibration.response.curves):
        encoded[..., k] = np.interp(light[..., k], curve, np.linspace(0.0, 1.0, curve.size))
    return encoded
