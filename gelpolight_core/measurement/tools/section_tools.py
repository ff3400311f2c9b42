"""Tools that read a section: its width."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import Profile, take_profile, width_at, width_ends
from gelpolight_core.reconstruction.height_map import HeightMap

from .tool_base import PaletteEntry, Point, Range, Tool, ToolResult, tool_result


@dataclass(frozen=True, slots=True)
class SectionTool(Tool):
    """A section through the map.

    Attributes
    ----------
    start_mm, end_mm, width_mm
        As in :func:`~gelpolight_core.measurement.profile.take_profile`.
    """

    start_mm: Point
    end_mm: Point
    width_mm: float = 0.0

    def section(self, heightmap: HeightMap) -> Profile:
        """Return the depth along it."""
        return take_profile(heightmap, self.start_mm, self.end_mm, width_mm=self.width_mm)


@dataclass(frozen=True, slots=True)
class ProfileWidthTool(SectionTool):
    """The width of what a profile crosses, at a level.

    Attributes
    ----------
    start_mm, end_mm, width_mm
        The profile, as in :func:`~gelpolight_core.measurement.profile.take_profile`.
    level_mm : float or None
        The depth at which it is measured; None: half way between least and greatest depth.
    between_mm : (float, float) or None
        The range along the profile; None: all of it.
    """

    name = "profile-width"
    palette = PaletteEntry(
        section="lines",
        order=30,
        tip="Width at half height, or at a depth",
        prompts=("Click the start of the section", "Click the end of the section"),
        key="W",
    )
    level_mm: float | None = None
    between_mm: Range | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        profile = self.section(heightmap)
        figure = width_at(profile, self.level_mm, between=self.between_mm)
        ends = width_ends(profile, self.level_mm, between=self.between_mm)
        figures = (figure, MeasuredValue(ends[2], None, "mm", "level"))
        return replace(_profile_result(self, profile, figures, (ends[:2],)), width_ends=ends)


def _profile_result(
    tool: Tool, profile: Profile, figures: tuple[MeasuredValue, ...], parts: tuple[Range, ...]
) -> ToolResult:
    """Return a result drawn as the line, and the parts of it that count."""
    start, end = np.array(profile.start_mm), np.array(profile.end_mm)
    length = float(profile.along_mm[-1])
    lines = [np.stack([start, end])]
    lines += [start + np.array(part)[:, None] / length * (end - start) for part in parts]
    valid_mask = np.isfinite(profile.depth_mm)
    return tool_result(tool, figures, tuple(lines), profile.flags[valid_mask], profile=profile)
