"""Measurements along the section line and in the rectangle on the height map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.form_fields import choice, number, switch
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import (
    Profile,
    step_height,
    take_profile,
    width_at,
    width_ends,
)
from gelpolight_core.measurement.roughness import profile_roughness, roughness
from gelpolight_core.reconstruction.height_map import HeightMap

# Those of ISO 21920-3 that fit on a sensor.
CUTOFFS_MM = (0.25, 0.8, 2.5)
CUTOFFS = {0.0: "off", **{c: f"cut-off {c:g} mm" for c in CUTOFFS_MM}}
MM = " mm"
ABOUT_WIDTH = "Depth is averaged over this width across the line"
ABOUT_LEVEL = "Depth at which the width is measured. 0: half of the height"
ABOUT_CUTOFF = (
    "Measure Ra, Rq and Rz along the line (ISO 21920). The cut-off separates roughness from "
    "waviness"
)


FLOOR, PLATEAU = (0.02, 0.14), (0.375, 0.625)
"""Parts between which the step is measured: the surface at the start, as shares of the line, and
the object's face, as shares of its width at half height. Each is long enough to average the noise,
and short enough for a small face."""


@dataclass(frozen=True, slots=True)
class SectionSettings:
    """Section of the height map along a line, with its measurements.

    Attributes
    ----------
    start_mm, end_mm : (x, y)
        Its ends.
    width_mm : float
        Depth is averaged over this width across the line.
    level_mm : float
        Depth at which the width is measured. 0: half of the height.
    cutoff_mm : float
        Cut-off of the roughness of the line. 0: it is not measured.
    region : bool
        Whether the roughness of the rectangle is measured.
    """

    start_mm: PointXY = (-6.0, 0.0)
    end_mm: PointXY = (6.0, 0.0)
    width_mm: float = number(0.2, "Line width", 0.0, 5.0, MM, 2, step=0.1, tip=ABOUT_WIDTH)
    level_mm: float = number(
        0.0, "Width at", 0.0, 5.0, MM, 3, step=0.01, none="half height", tip=ABOUT_LEVEL
    )
    cutoff_mm: float = choice(0.0, "Ra, Rq, Rz", CUTOFFS, ABOUT_CUTOFF)
    region: bool = switch(
        False, "Sa, Sq, Sz", "in a rectangle", "Measure Sa, Sq and Sz on the height map"
    )


@dataclass(frozen=True, slots=True, eq=False)
class SectionResult:
    """Measurements of one frame along the section line and in the rectangle.

    Attributes
    ----------
    profile : Profile or None
        The depth along the line. None if there is none.
    figures : tuple of MeasuredValue
        Measurements of the profile, then of the rectangle.
    sentences : tuple of str
        Why something could not be measured.
    width_ends : (left, right, level) or None
        Ends of the width: two positions along the line, and their depth; mm.
    step_parts : tuple of (start, end)
        The two parts of the line between which the step is measured, mm. Empty if it is not.
    """

    profile: Profile | None = None
    figures: tuple[MeasuredValue, ...] = ()
    sentences: tuple[str, ...] = ()
    width_ends: tuple[float, float, float] | None = None
    step_parts: tuple[PointXY, ...] = ()


def measure_sections(
    heightmap: HeightMap, section: SectionSettings, region: Rectangle | None
) -> SectionResult:
    """Take the profile of the line, and measure along it and in a rectangle."""
    profile: Profile | None = None
    ends: tuple[float, float, float] | None = None
    figures: list[MeasuredValue] = []
    sentences: list[str] = []
    parts: list[PointXY] = []

    def measured(measure: Callable[[], Sequence[MeasuredValue]]) -> None:
        try:
            figures.extend(measure())
        except InputError as error:
            sentences.append(error.found)

    def step(taken: Profile) -> list[MeasuredValue]:
        start, end, _ = width_ends(taken)
        parts.append((FLOOR[0] * taken.along_mm[-1], FLOOR[1] * taken.along_mm[-1]))
        parts.append((start + PLATEAU[0] * (end - start), start + PLATEAU[1] * (end - start)))
        return [step_height(taken, *parts)]

    try:
        profile = taken = take_profile(
            heightmap, section.start_mm, section.end_mm, width_mm=section.width_mm
        )
    except InputError as error:
        sentences.append(str(error))
    else:
        level_mm = section.level_mm or None
        measured(lambda: step(taken))
        measured(lambda: [width_at(taken, level_mm)])
        if section.cutoff_mm:
            measured(lambda: profile_roughness(taken, cutoff_mm=section.cutoff_mm))
        if any(figure.name == "width" for figure in figures):
            ends = width_ends(taken, level_mm)
    if region is not None:
        measured(lambda: roughness(heightmap, region))
    said = tuple(dict.fromkeys(sentences))
    return SectionResult(profile, tuple(figures), said, ends, tuple(parts))
