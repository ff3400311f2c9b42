"""The light that an image shows where a surface turns its back to an LED.

Nothing lights these nodes but other parts of the membrane. What is left is a loss of contrast: a
share of the frame before, in which no contact was there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.health.contact_residual import ALIKE
from gelpolight_core.health.fault_limits import SIGMAS
from gelpolight_core.reconstruction.compiled import whole
from gelpolight_core.reconstruction.height_map import COARSE

from .kernel_structures import UNCHANGED
from .region_solution import SolvedRegion
from .sensor_maps import SensorMaps

GENTLE = 0.2
"""Slope below which no node faces away from an LED of a usable sensor."""
LEAST_NODES = 12
"""Nodes at quarter scale in shadows of LEDs; fewer can be specks or an edge."""
MOST = 0.3
"""Share of a frame before. If more is left in shadows, they are none: the surface is wrong."""


@dataclass(frozen=True, slots=True)
class ShadowFloor:
    """Light in shadows that nothing explains.

    Attributes
    ----------
    share : float
        Over the light of the untouched membrane: share of the frame before.
    sd : float
        Standard deviation.
    """

    share: float
    sd: float

    @property
    def is_clear(self) -> bool:
        """Whether it is more than errors of the model explain, and no wrong surface."""
        return SIGMAS * self.sd < self.share < MOST

    @property
    def finding(self) -> Finding:
        """The finding, whose effect on the heights is corrected."""
        text = (
            f"shadows of the contact are too bright by {100.0 * self.share:.1f} %: the camera "
            "blends in the frame before, or has less contrast"
        )
        return Finding(
            "blended",
            text,
            100.0 * self.share,
            "%",
            verdict=Verdict.WARN,
            remedy="The depth is corrected for this. Switch temporal noise reduction off",
            heights=HeightReliability.STATED,
        )


def shadow_floor(
    solved: SolvedRegion, maps: SensorMaps, *, before: float = 0.0
) -> ShadowFloor | None:
    """Return the floor of a solved region's shadows, or None where it has hardly any.

    Parameters
    ----------
    solved : SolvedRegion
        The region.
    maps : SensorMaps
        Precomputed calibration data.
    before : float, optional
        Share of the frame before that its image was corrected for.
    """
    coarse, step = maps.scale(COARSE), COARSE // solved.scale.factor
    corner, shape = solved.region.at(1)
    window = solved.region.window(1)
    depth = solved.depth_mm
    if depth.shape != shape:
        depth = np.asarray(cv2.resize(depth, shape[::-1], interpolation=cv2.INTER_AREA))
    place = coarse.x_mm + coarse.pitch_mm * corner[1], coarse.y_mm + coarse.pitch_mm * corner[0]
    rest = UNCHANGED if coarse.rest is None else coarse.rest[(slice(None), *window)]
    image = solved.compared.fine
    seen = np.full((3, *shape), np.nan, np.float32)
    _turned_away(
        depth,
        rest,
        *place,
        coarse.pitch_mm,
        np.asarray(maps.full.led_positions_mm, np.float64),
        coarse.kind[window],
        image.ratio,
        image.marks,
        image.around,
        step,
        seen,
    )
    left = seen[np.isfinite(seen)]
    if left.size < LEAST_NODES:
        return None
    shadows = np.isfinite(seen).any(axis=(1, 2)).sum()
    share = float(np.median(left))
    scatter = float(np.median(np.abs(left - share)))
    by_nodes = scatter / math.sqrt(max(left.size / ALIKE, 1.0))
    # Errors of the model differ from shadow to shadow.
    sd = math.hypot(by_nodes, maps.full.misfit / math.sqrt(shadows))
    return ShadowFloor(before + (1.0 - before) * share, (1.0 - before) * sd)


@whole
def _turned_away(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    depth, rest, x_mm, y_mm, pitch_mm, leds, kind, ratio, marks, around, step, seen
):
    """Write the light (3, rows, columns) of nodes that face away from an LED, less known light."""
    rows, columns = depth.shape
    reflects, curved = around.shape[2] > 1, rest.size > 0
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            m, n = i * step + step // 2, j * step + step // 2
            if kind[i, j] != 2 or marks[m, n] & 7:
                continue
            along_x = (depth[i, j + 1] - depth[i, j - 1]) / (2.0 * pitch_mm)
            along_y = (depth[i + 1, j] - depth[i - 1, j]) / (2.0 * pitch_mm)
            if along_x * along_x + along_y * along_y < GENTLE * GENTLE:
                continue
            # By how much the slopes of the four facets at the node differ from their mean.
            bent_x = abs(0.5 * (depth[i, j + 1] + depth[i, j - 1]) - depth[i, j]) / pitch_mm
            bent_y = abs(0.5 * (depth[i + 1, j] + depth[i - 1, j]) - depth[i, j]) / pitch_mm
            height = 0.0
            if curved:
                height = rest[0, i, j]
                along_x -= rest[1, i, j]
                along_y -= rest[2, i, j]
            short = 1.0 / np.sqrt(along_x * along_x + along_y * along_y + 1.0)
            normal = (-along_x * short, -along_y * short, -short)
            for k in range(3):
                x, y = leds[k, 0] - x_mm - pitch_mm * j, leds[k, 1] - y_mm - pitch_mm * i
                z = leds[k, 2] + depth[i, j] - height
                lit = (bent_x * abs(x) + bent_y * abs(y)) * short
                if normal[0] * x + normal[1] * y + normal[2] * z < -lit:
                    known = 0.0
                    if reflects:
                        known = around[k, m, n]
                        for c in range(3):
                            known += around[3 + 3 * k + c, m, n] * normal[c]
                    seen[k, i, j] = ratio[k, m, n] - max(known, 0.0)
