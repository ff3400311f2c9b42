"""Measurements along the section lines and in the rectangle on the height map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from gelpolight_core.errors import InputError
from gelpolight_core.fields import choice, number, switch
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.measurement.profile import (
    Profile,
    angle_between,
    slope,
    step_height,
    take_profile,
    width_at,
    width_ends,
)
from gelpolight_core.measurement.roughness import profile_roughness, roughness
from gelpolight_core.reconstruction.height_map import HeightMap

Point = tuple[float, float]
# Those of ISO 21920-3 that fit on a sensor.
CUTOFFS_MM = (0.25, 0.8, 2.5)
CUTOFFS = {0.0: "none", **{c: f"at {c:g} mm" for c in CUTOFFS_MM}}
MM = " mm"
ABOUT_WIDTH = "Depth is averaged over this width across the line"
ABOUT_LEVEL = "Depth at which the width is measured. 0: half of the height"
ABOUT_CUTOFF = (
    "Measure Ra, Rq and Rz along the line (ISO 21920). The cut-off separates roughness from "
    "waviness"
)


@dataclass(frozen=True, slots=True)
class Line:
    """A line over the height map.

    Attributes
    ----------
    start_mm, end_mm : (x, y)
        Its ends.
    number : int
        Its number, which gives it its colour.
    """

    start_mm: Point = (-6.0, 0.0)
    end_mm: Point = (6.0, 0.0)
    number: int = 1


@dataclass(frozen=True, slots=True)
class Section:
    """Lines over the height map, and two ranges of one of them that are compared.

    Attributes
    ----------
    lines : tuple of Line
        All lines.
    chosen : int
        Number of the line that is measured.
    width_mm : float
        Depth is averaged over this width across each line.
    level_mm : float
        Depth at which the width is measured. 0: half of the height.
    cutoff_mm : float
        Cut-off of the roughness of the line. 0: it is not measured.
    region : bool
        Whether the roughness of the rectangle is measured.
    first, second : (from, to)
        Ranges as shares of the line's length.
    """

    lines: tuple[Line, ...] = (Line(),)
    chosen: int = 1
    width_mm: float = number(0.2, "Width", 0.0, 5.0, MM, 2, step=0.1, tip=ABOUT_WIDTH)
    level_mm: float = number(
        0.0, "Width at", 0.0, 5.0, MM, 3, step=0.01, none="half height", tip=ABOUT_LEVEL
    )
    cutoff_mm: float = choice(0.0, "Ra, Rq, Rz", CUTOFFS, ABOUT_CUTOFF)
    region: bool = switch(
        False, "", "Roughness", "Measure Sa, Sq and Sz in a rectangle on the height map"
    )
    first: Point = (0.02, 0.14)
    second: Point = (0.44, 0.56)


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Measurements of one frame.

    Attributes
    ----------
    profiles : mapping of int to Profile
        The profile of each line by its number, except of those that could not be taken.
    chosen : int
        Number of the line that is measured.
    figures : tuple of Measured
        Of the chosen profile, then of the rectangle.
    sentences : tuple of str
        Why something could not be measured.
    width_ends : (left, right, level) or None
        Ends of the width: two positions along the line, and their depth; mm.
    """

    profiles: Mapping[int, Profile] = field(default_factory=dict)
    chosen: int = 1
    figures: tuple[Measured, ...] = ()
    sentences: tuple[str, ...] = ()
    width_ends: tuple[float, float, float] | None = None

    @property
    def profile(self) -> Profile | None:
        """The profile of the chosen line. None if there is none."""
        return self.profiles.get(self.chosen)


def cut(heightmap: HeightMap, section: Section, region: Rectangle | None) -> Cut:
    """Take the profile of each line, and measure along the chosen one and in a rectangle."""
    ends: tuple[float, float, float] | None = None
    figures: list[Measured] = []
    sentences: list[str] = []
    profiles: dict[int, Profile] = {}
    for line in section.lines:
        try:
            profiles[line.number] = take_profile(
                heightmap, line.start_mm, line.end_mm, width_mm=section.width_mm
            )
        except InputError as error:
            if line.number == section.chosen:
                sentences.append(str(error))

    def measured(measure: Callable[[], Sequence[Measured]]) -> None:
        try:
            figures.extend(measure())
        except InputError as error:
            sentences.append(error.found)

    profile = profiles.get(section.chosen)
    if profile is not None:
        length = float(profile.along_mm[-1])
        first = (length * section.first[0], length * section.first[1])
        second = (length * section.second[0], length * section.second[1])
        measured(lambda: [step_height(profile, first_mm=first, second_mm=second)])
        measured(lambda: [width_at(profile, section.level_mm or None)])
        measured(lambda: [slope(profile, *first)])
        measured(lambda: [slope(profile, *second)])
        measured(lambda: [angle_between(profile, first, second)])
        if section.cutoff_mm:
            measured(lambda: profile_roughness(profile, cutoff_mm=section.cutoff_mm))
        if any(figure.name == "width" for figure in figures):
            ends = width_ends(profile, section.level_mm or None)
    if region is not None:
        measured(lambda: roughness(heightmap, region))
    return Cut(profiles, section.chosen, tuple(figures), tuple(dict.fromkeys(sentences)), ends)
