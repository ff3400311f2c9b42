"""A press as the planned solve wants it: press over background in a region, at two scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.reconstruction.buffers import Buffers
from gelpolight_core.reconstruction.full import RIM_CHANGE, SATURATED, crossed_rim
from gelpolight_core.reconstruction.live_maps import LiveMaps, light_levels
from gelpolight_core.reconstruction.live_pixels import halve, sample_rows
from gelpolight_core.reconstruction.region import Region
from gelpolight_core.reconstruction.threads import RowWorkers

Map = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class PressPicture:
    """Press over background in a region of one scale.

    Attributes
    ----------
    ratio : (3, rows, columns) float32
        Press over background.
    saturated : (rows, columns) uint8
        A bit for each channel.
    around : (3, rows, columns) float32
        Ratio averaged over the surroundings; (3, 1, 1) where nobody needs it.
    let_go : (rows, columns) bool or None
        Where a contact crosses the rim; None where none does.
    """

    ratio: Map
    saturated: NDArray[np.uint8]
    around: Map
    let_go: NDArray[np.bool_] | None


class PressSampler:
    """Compares raw pictures with the background.

    Parameters
    ----------
    calibration, full, maps
        The sensor's.
    workers : RowWorkers
        Threads.
    buffers : Buffers
        What it returns lies in these.
    """

    def __init__(
        self,
        calibration: Calibration,
        full: FullModel,
        maps: LiveMaps,
        workers: RowWorkers,
        buffers: Buffers,
    ) -> None:
        self.maps = maps
        self._response = calibration.response
        self._reach_mm = full.membrane.bounce_reach_mm
        self._workers = workers
        self._take = buffers.take
        inverse = np.linalg.inv(calibration.crosstalk).astype(np.float32)
        self._unmix = tuple(tuple(row) for row in inverse)
        self._light: dict[tuple[np.dtype[Any], bool], Map] = {}

    def compare(
        self, raw: NDArray[Any], region: Region, *, linear: bool
    ) -> tuple[PressPicture, PressPicture]:
        """Return press over background at half and at quarter scale.

        Parameters
        ----------
        raw : (height, width, 3) uint8 or uint16
            Raw picture.
        region : Region
            Where.
        linear : bool
            Whether its numbers are linear light, whatever the camera's response.
        """
        maps = self.maps
        corner, shape = region.at(2)
        small = region.shape
        ratio, coarse = self._take("ratio", (3, *shape)), self._take("coarse", (3, *small))
        marks = self._take("saturated", shape, np.uint8)
        coarse_marks = self._take("coarse saturated", small, np.uint8)
        limit = np.float32(SATURATED)
        self._workers.run(
            shape[0],
            sample_rows,
            raw,
            self._levels(raw.dtype, linear),
            limit,
            maps.u_px,
            maps.v_px,
            self._unmix,
            maps.gain,
            maps.half.kind,
            corner,
            ratio,
            marks,
        )
        halve(ratio, marks, coarse, coarse_marks)
        around = coarse_around = self._take("no surroundings", (3, 1, 1))
        let_go = None
        (top, left), kind = region.corner, maps.quarter.kind
        kind = kind[top : top + small[0], left : left + small[1]]
        if (
            maps.membrane.bounce is not None
            or not kind.all()
            or region.at_border(maps.quarter.shape)
        ):
            coarse_around = self._around(coarse)
            let_go = self._released(coarse_around, kind)
        if maps.membrane.bounce is not None:
            around = self._take("around", (3, *shape))
            for k in range(3):
                cv2.resize(coarse_around[k], shape[::-1], around[k])
        large = None
        if let_go is not None:
            large = np.repeat(np.repeat(let_go, 2, axis=0), 2, axis=1)
        return (
            PressPicture(ratio, marks, around, large),
            PressPicture(coarse, coarse_marks, coarse_around, let_go),
        )

    def _around(self, coarse: Map) -> Map:
        """Return press over background, averaged over the surroundings; as `neighbourhood`."""
        reach = self._reach_mm / self.maps.quarter.pitch_mm
        factor = max(int(reach / 4.0), 1)
        rows, columns = coarse.shape[1:]
        size = (max(columns // factor, 1), max(rows // factor, 1))
        result = self._take("coarse around", coarse.shape)
        for k in range(3):
            known = np.clip(coarse[k], 0.0, 4.0)
            small = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
            small = cv2.GaussianBlur(small, (0, 0), reach / factor)
            cv2.resize(small, (columns, rows), result[k])
        return result

    def _released(self, around: Map, kind: NDArray[np.uint8]) -> NDArray[np.bool_] | None:
        """Return where a contact crosses the rim, or None where it does not."""
        disturbed = np.abs(around - 1.0).max(axis=0) > RIM_CHANGE
        let_go = crossed_rim(kind > 0, disturbed, self.maps.quarter.pitch_mm)
        return let_go if let_go.any() else None

    def _levels(self, dtype: np.dtype[Any], linear: bool) -> Map:
        kind = (dtype, linear)
        if kind not in self._light:
            response = None if linear else self._response
            self._light[kind] = light_levels(response, dtype)
        return self._light[kind]
