"""Tools that read a section: its width."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import Profile, take_profile, width_at, width_ends
from gelpolight_core.reconstruction.height_map import HeightMap

from .tool_base import PaletteEntry, Point, Tool, ToolResult, tool_result


@dataclass(frozen=True, slots=True)
class SectionTool(Tool):
    """A section through the map.

    Attributes
    ----------
    start_mm, end_mm
        As in :func:`~gelpolight_core.measurement.profile.take_profile`.
    """

    start_mm: Point
    end_mm: Point

    def section(self, heightmap: HeightMap) -> Profile:
        """Return the depth along it."""
        return take_profile(heightmap, self.start_mm, self.end_mm)

    def line_with_part(
        self, profile: Profile, begin_mm: float, finish_mm: float
    ) -> tuple[Float64Array, Float64Array]:
        """Return the section as a line (2, 2), and the part of it that counts."""
        start, end = np.array(self.start_mm), np.array(self.end_mm)
        length = float(profile.along_mm[-1])
        part = start + np.array([[begin_mm], [finish_mm]]) / length * (end - start)
        return np.stack([start, end]), part


@dataclass(frozen=True, slots=True)
class ProfileWidthTool(SectionTool):
    """The width of what a profile crosses, half way between least and greatest depth.

    Attributes
    ----------
    start_mm, end_mm
        The profile, as in :func:`~gelpolight_core.measurement.profile.take_profile`.
    """

    name = "profile-width"
    palette = PaletteEntry(
        section="lines",
        order=30,
        tip="Width at half height",
        prompts=("Click the start of the section", "Click the end of the section"),
        key="W",
    )

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        profile = self.section(heightmap)
        begin, finish, level = ends = width_ends(profile)
        figures = (width_at(profile), MeasuredValue(level, None, "mm", "level"))
        flags = profile.flags[np.isfinite(profile.depth_mm)]
        lines = self.line_with_part(profile, begin, finish)
        result = tool_result(self, figures, lines, flags, profile=profile)
        return replace(result, width_ends=ends)
