"""Shadow under point light and under directional light (the paper's Fig. 1), as numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gelpolight_core.design.parts import LedDesign
from gelpolight_core.drawing_thread import in_drawing_thread
from gelpolight_core.simulation.indenters import Cylinder, press
from gelpolight_core.simulation.lamps import Lamp, ParallelLamp, PointLamp, lamp_table
from gelpolight_core.simulation.occlusion import lit_share
from gelpolight_core.simulation.surface import PressedSurface

Array = NDArray[np.float64]

_AZIMUTHS_DEG = (90.0, 210.0, 330.0)
_LIT = 0.5
"""A cell counts as shadow if less than half of a lamp's disc is visible from it."""


@dataclass(frozen=True, slots=True)
class ShadowRow:
    """Shadow of one kind of light at one depth.

    Attributes
    ----------
    lighting : str
        "point" or "directional".
    setting : float
        LED height in mm for point light, elevation in degrees for directional light.
    depth_mm : float
        Indentation.
    mean_shadow_mm2 : float
        Area dark under one light, mean of the three.
    any_shadow_mm2 : float
        Area dark under at least one light, where the plain three-light solution fails.
    two_dark_mm2 : float
        Area dark under two or three lights, where no light-based solution exists.
    """

    lighting: str
    setting: float
    depth_mm: float
    mean_shadow_mm2: float
    any_shadow_mm2: float
    two_dark_mm2: float


@dataclass(frozen=True, slots=True)
class ShadowComparison:
    """The table of the comparison, point light first."""

    rows: tuple[ShadowRow, ...]
    diameter_mm: float
    x_mm: float
    y_mm: float

    def curve(self, lighting: str, setting: float) -> tuple[Array, Array]:
        """Return (depth_mm, any_shadow_mm2) for one kind of light."""
        chosen = [r for r in self.rows if r.lighting == lighting and r.setting == setting]
        return (
            np.array([r.depth_mm for r in chosen]),
            np.array([r.any_shadow_mm2 for r in chosen]),
        )


def directional_lamps(elevation_deg: float) -> tuple[ParallelLamp, ...]:
    """Return three parallel lights 120 degrees apart."""
    return tuple(ParallelLamp(azimuth, elevation_deg) for azimuth in _AZIMUTHS_DEG)


def point_lamps(height_mm: float, circle_radius_mm: float) -> tuple[PointLamp, ...]:
    """Return three small lamps on a circle, 120 degrees apart."""
    angles = [math.radians(azimuth) for azimuth in _AZIMUTHS_DEG]
    return tuple(
        PointLamp(circle_radius_mm * math.cos(a), circle_radius_mm * math.sin(a), height_mm)
        for a in angles
    )


def shadow_areas(surface: PressedSurface, lamps: tuple[Lamp, ...]) -> tuple[float, float, float]:
    """Return the areas dark under one lamp (mean), under any, and under two or more, in mm2.

    Both attached shadow (the surface faces away) and cast shadow count.

    Parameters
    ----------
    surface : PressedSurface
        The membrane.
    lamps : tuple of PointLamp or ParallelLamp
        Three lights.
    """
    grid = (
        surface.x0_mm,
        surface.y0_mm,
        surface.pitch_mm,
        float(surface.depth_mm.max(initial=0.0)),
    )
    share = lit_share(
        surface.depth_mm,
        surface.tile_max,
        grid,
        (surface.slope_x, surface.slope_y),
        lamp_table(lamps),
    )
    dark = np.asarray(share) < _LIT
    cell = surface.pitch_mm**2
    number = dark.sum(axis=2)
    return (
        float(dark.sum(axis=(0, 1)).mean() * cell),
        float((number >= 1).sum() * cell),
        float((number >= 2).sum() * cell),
    )


def shadow_comparison(
    *,
    leds: Sequence[LedDesign] = (),
    led_heights_mm: Sequence[float] = (8.0, 13.7, 20.0),
    elevations_deg: Sequence[float] = (15.0, 30.0, 45.0),
    depths_mm: Sequence[float] = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5),
    diameter_mm: float = 5.0,
    circle_radius_mm: float = 12.0,
    x_mm: float = 0.0,
    y_mm: float = 0.0,
    decay_mm: float = 0.7,
    pitch_mm: float = 0.04,
) -> ShadowComparison:
    """Measure the shadow of a pressed cylinder under both kinds of light.

    Parameters
    ----------
    leds : sequence of LedDesign, optional
        The LEDs of a design; they replace the lamps on a circle.
    led_heights_mm : sequence of float, optional
        Heights below the top surface of lamps on a circle, each tested in turn.
    elevations_deg : sequence of float, optional
        Elevations of the directional light above the surface.
    depths_mm : sequence of float, optional
        Indentation depths.
    diameter_mm, x_mm, y_mm : float, optional
        The cylinder and its position.
    circle_radius_mm : float, optional
        Radius of the circle of point lamps.
    decay_mm, pitch_mm : float, optional
        Decay length of the membrane, cell size of the surface.

    Returns
    -------
    ShadowComparison
    """
    own = tuple(PointLamp(led.x_mm, led.y_mm, led.height_mm) for led in leds)
    lightings: list[tuple[str, float, tuple[Lamp, ...]]] = [
        ("point", height, point_lamps(height, circle_radius_mm)) for height in led_heights_mm
    ]
    if own:
        lightings = [("point", float(np.mean([lamp.height_mm for lamp in own])), own)]
    lightings += [
        ("directional", elevation, directional_lamps(elevation)) for elevation in elevations_deg
    ]
    surfaces = [
        press(
            Cylinder(diameter_mm, depth),
            x_mm=x_mm,
            y_mm=y_mm,
            decay_mm=decay_mm,
            pitch_mm=pitch_mm,
            margin_mm=_longest_shadow(depth, min(elevations_deg, default=90.0)),
        )
        for depth in depths_mm
    ]
    rows = tuple(
        ShadowRow(name, float(setting), float(depth), *shadow_areas(surface, lamps))
        for name, setting, lamps in lightings
        for depth, surface in zip(depths_mm, surfaces, strict=True)
    )
    return ShadowComparison(rows, diameter_mm, x_mm, y_mm)


def _longest_shadow(depth_mm: float, elevation_deg: float) -> float:
    """Length of the shadow from the lowest directional light, with some margin."""
    return 0.5 + depth_mm / math.tan(math.radians(elevation_deg))


@in_drawing_thread
def draw_shadow_comparison(comparison: ShadowComparison, file: Path | BinaryIO) -> None:
    """Draw the area dark under at least one light over the depth, to a PNG file.

    Parameters
    ----------
    comparison : ShadowComparison
        The table.
    file : Path or binary file
        Destination of the PNG.
    """
    figure = Figure(figsize=(6.4, 4.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for lighting, style, unit in (("point", "-o", "mm high"), ("directional", "--s", "deg")):
        settings = dict.fromkeys(r.setting for r in comparison.rows if r.lighting == lighting)
        for setting in settings:
            depth, area = comparison.curve(lighting, setting)
            axes.plot(depth, area, style, markersize=4, label=f"{lighting}, {setting:g} {unit}")
    axes.set_xlabel("indentation depth (mm)")
    axes.set_ylabel("area dark under at least one light (mm²)")
    axes.set_title(f"Shadow of a cylinder of {comparison.diameter_mm:g} mm")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(file, format="png")
