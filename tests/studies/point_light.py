"""The paper's Fig. 1 in numbers: one object under point and under directional light.

``python -m tests.studies.point_light [DESIGN.toml]`` prints how much of a pressed cylinder is in
shadow under both kinds of light, and the depth error of the near-light model and of the same model
with its LEDs moved far away, as directional methods assume.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.depth_score import TrueDepth, score_depth, scored_radius_mm
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import CylinderIndenter, press_surface
from gelpolight_core.simulation.lamps import PointLamp, lamp_table, lamps_of
from gelpolight_core.simulation.occlusion import lamp_share
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign, read_design
from gelpolight_core.simulation.simulation_kernel import compiled
from gelpolight_core.simulation.virtual_sensor import VirtualSensor
from gelpolight_core.studies.exact_sensor import (
    ExactSensor,
    exact_calibration,
    with_lambertian_membrane,
)

AZIMUTHS_DEG = (90.0, 210.0, 330.0)
DEPTH_MM = 1.0
WIDTH_PX = 320
TOUCHED_MM, FAR_MM, INFINITE_MM = 0.02, 1e4, 1e6
HEIGHT_SHARES, ELEVATIONS_DEG = (0.6, 1.0, 1.5), (15.0, 30.0, 45.0)


@dataclass(frozen=True)
class Row:
    """Shares of the contact that are dark, and RMS errors in um; None where it is refused."""

    light: str
    shadow_percent: float
    unsolved_percent: float
    near_um: float | None
    directional_um: float | None


def parallel_light(azimuth_deg: float, elevation_deg: float) -> PointLamp:
    """Return a lamp so far away that its light is parallel, of power 1 on a surface facing it."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    x_mm, y_mm = INFINITE_MM * np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    return PointLamp(x_mm, y_mm, INFINITE_MM * np.sin(elevation), INFINITE_MM**2, 0.0, 0.0)


@compiled
def lit_share(depth, tile_max, grid, slopes, lamps):  # pragma: no cover - compiled
    """Return (rows, columns, lamps): the visible share of each lamp from each cell.

    A cell whose surface faces away from a lamp does not see it.
    """
    rows, columns = depth.shape
    share = np.zeros((rows, columns, lamps.shape[0]))
    for i in range(rows):
        for j in range(columns):
            x, y, d = grid[0] + j * grid[2], grid[1] + i * grid[2], depth[i, j]
            for k in range(lamps.shape[0]):
                lx, ly, lz = lamps[k, 0] - x, lamps[k, 1] - y, lamps[k, 2] + d
                if -(slopes[0][i, j] * lx + slopes[1][i, j] * ly + lz) > 0.0:
                    share[i, j, k] = lamp_share(depth, tile_max, grid, (x, y, d), lamps[k])
    return share


def shadow_areas(
    surface: PressedSurface, lamps: tuple[PointLamp, ...]
) -> tuple[float, float, float]:
    """Return the areas dark under one lamp (mean), under any, and under two or more, in mm2."""
    deepest = float(surface.depth_mm.max(initial=0.0))
    grid = (surface.x0_mm, surface.y0_mm, surface.pitch_mm, deepest)
    slopes = surface.slope_x, surface.slope_y
    share = lit_share(surface.depth_mm, surface.tile_max, grid, slopes, lamp_table(lamps))
    dark = np.asarray(share) < 0.5
    number, cell = dark.sum(axis=2), surface.pitch_mm**2
    areas = dark.sum(axis=(0, 1)).mean(), (number >= 1).sum(), (number >= 2).sum()
    mean, some, two = (float(area * cell) for area in areas)
    return mean, some, two


def rows(
    design: SensorDesign,
    height_shares: tuple[float, ...] = HEIGHT_SHARES,
    elevations_deg: tuple[float, ...] = ELEVATIONS_DEG,
) -> Iterator[Row]:
    """Press a cylinder, off the middle so that no symmetry helps, under each light."""
    plain = with_lambertian_membrane(design).scaled(WIDTH_PX / design.camera.width_px)
    decay_mm = plain.membrane.decay_length_mm
    surface = press_surface(CylinderIndenter(5.0, DEPTH_MM), x_mm=2.0, y_mm=1.0, decay_mm=decay_mm)
    for share in height_shares:
        leds = tuple(replace(led, height_mm=share * led.height_mm) for led in plain.leds)
        lit = replace(plain, leds=leds)
        places = np.array([[led.x_mm, led.y_mm, -led.height_mm] for led in leds])
        yield _row(f"point, {-places[:, 2].mean():.1f} mm", lit, lamps_of(lit), places, surface)
    for elevation in elevations_deg:
        lamps = tuple(parallel_light(azimuth, elevation) for azimuth in AZIMUTHS_DEG)
        azimuth, rise = np.radians(AZIMUTHS_DEG), np.radians(elevation)
        flat = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        towards = np.column_stack([np.cos(rise) * flat, np.full(3, -np.sin(rise))])
        # The near-light model has its LEDs in these directions, at the design's height.
        height = np.mean([led.height_mm for led in plain.leds])
        places = towards * (height / -towards[:, 2:])
        yield _row(f"directional, {elevation:.0f} degrees", plain, lamps, places, surface)


def _row(
    name: str,
    design: SensorDesign,
    lamps: tuple[PointLamp, ...],
    leds_mm: np.ndarray,
    surface: PressedSurface,
) -> Row:
    sensor = VirtualSensor(design, lamps=lamps)
    _, dark, two_dark = shadow_areas(surface, lamps)
    pressed = (surface.depth_mm > TOUCHED_MM).sum() * surface.pitch_mm**2
    far_mm = leds_mm * (FAR_MM / np.linalg.norm(leds_mm, axis=1, keepdims=True))
    near, directional = (_rms_um(sensor, places, surface) for places in (leds_mm, far_mm))
    return Row(name, 100.0 * dark / pressed, 100.0 * two_dark / pressed, near, directional)


def _rms_um(sensor: VirtualSensor, leds_mm: np.ndarray, surface: PressedSurface) -> float | None:
    try:
        known = ExactSensor(sensor, exact_calibration(sensor, leds_mm=leds_mm))
        frame = known.showing(surface, samples=1).frame
        found = Reconstructor(known.calibration).depth(frame, normals=False)
    except InputError:
        return None
    truth = TrueDepth(surface.depth_mm, surface.x_mm, surface.y_mm)
    radius_mm = scored_radius_mm(known.calibration.data.sensor)
    places = found.depth_mm, found.x_mm, found.y_mm
    return score_depth(*places, truth, height_mm=DEPTH_MM, radius_mm=radius_mm).rms_um


if __name__ == "__main__":
    for row in rows(read_design(Path(sys.argv[1])) if sys.argv[1:] else SensorDesign()):
        print(row)
