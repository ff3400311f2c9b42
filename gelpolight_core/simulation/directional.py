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
ELEVATIONS_DEG = (15.0, 30.0, 45.0)
"""Of the directional light above the surface."""
DIAMETER_MM = 5.0
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
    """

    lighting: str
    setting: float
    depth_mm: float
    mean_shadow_mm2: float
    any_shadow_mm2: float


@dataclass(frozen=True, slots=True)
class ShadowComparison:
    """The table of the comparison, point light first."""

    rows: tuple[ShadowRow, ...]
    diameter_mm: float

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
    leds: Sequence[LedDesign],
    *,
    decay_mm: float,
    depths_mm: Sequence[float] = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5),
    pitch_mm: float = 0.04,
) -> ShadowComparison:
    """Measure the shadow of a pressed cylinder under the LEDs and under directional light.

    Parameters
    ----------
    leds : sequence of LedDesign
        The LEDs of a design.
    decay_mm : float
        Decay length of the membrane.
    depths_mm : sequence of float, optional
        Indentation depths.
    pitch_mm : float, optional
        Cell size of the surface.
    """
    lamps = tuple(PointLamp(led.x_mm, led.y_mm, led.height_mm) for led in leds)
    lightings: list[tuple[str, float, tuple[Lamp, ...]]] = [
        ("point", float(np.mean([lamp.height_mm for lamp in lamps])), lamps),
        *(("directional", elevation, directional_lamps(elevation)) for elevation in ELEVATIONS_DEG),
    ]
    rows = []
    for depth in depths_mm:
        # The shadow from the lowest directional light, with some margin.
        margin_mm = 0.5 + depth / math.tan(math.radians(min(ELEVATIONS_DEG)))
        surface = press(
            Cylinder(DIAMETER_MM, depth), decay_mm=decay_mm, pitch_mm=pitch_mm, margin_mm=margin_mm
        )
        for name, setting, lit_by in lightings:
            rows.append(ShadowRow(name, setting, depth, *shadow_areas(surface, lit_by)[:2]))
    return ShadowComparison(tuple(rows), DIAMETER_MM)


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
