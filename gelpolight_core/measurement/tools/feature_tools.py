"""Tools for features of a surface: pit or bump, scratch, and the radius of an edge.

Heights are those of the object: positive where it stands out, and so presses deeper into the gel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import doubtful_finding
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.geometry.fits import above_plane
from gelpolight_core.measurement.area import AreaNodes, Rectangle, nodes_inside
from gelpolight_core.measurement.measured_value import (
    MeasuredValue,
    errors_at,
    lateral_length,
    measure_with_errors,
)
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.measurement.roughness import ERROR_NODES
from gelpolight_core.reconstruction.height_map import HeightMap

from .edge_search import fit_circle
from .section_tools import SectionTool
from .tool_base import PaletteEntry, Tool, ToolResult, tool_result

SURROUNDINGS = 0.2
"""Share of the half sides of a rectangle, or of the length of a section at each end, that shows the
surface around the feature."""
CORE = 0.8
"""Nodes above this share of the height belong to the core of a pit or bump. Its height is that of a
smooth surface through the core, because the highest node is high by its noise."""
LEAST_CORE = 12
CLEAR = 3.0
"""Standard deviations by which a feature must stand out."""
BRIDGED = 6.0
"""Width of a pit or scratch, in decay lengths of the drape, below which the membrane does not reach
its bottom: at this width it reaches 80 % of the depth of a round pit, and 90 % of a scratch."""
LEAST_BEND = 1e-6
"""Bend in 1/mm below which a section is straight."""
LEAST_ARC_DEG = 30.0
"""With a shorter arc, the radius depends on single nodes."""


@dataclass(frozen=True, slots=True)
class PitTool(Tool):
    """A pit or bump inside a rectangle whose margin shows the surface around it.

    Attributes
    ----------
    rectangle : Rectangle
        Around the feature, with a margin of a fifth of its half sides.
    """

    name = "pit"
    palette = PaletteEntry(
        label="Pit or bump",
        section="features",
        order=10,
        tip="Height above the surface around it, diameter at half of it",
        prompts=(
            "Click one corner, beside the pit or bump",
            "Click the opposite corner, on the other side",
        ),
        key="I",
    )
    rectangle: Rectangle

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure height against the surroundings, and diameter at half of it."""
        nodes = nodes_inside(heightmap, self.rectangle)
        around = _margin(nodes, self.rectangle)
        relief = _relief_of_area(nodes, around, self.rectangle)
        sign = _sign_of(relief[~around])
        core = ~around & (sign * relief > CORE * _extreme(sign * relief[~around]))
        few = nodes.thinned(ERROR_NODES)
        margin = _margin(few, self.rectangle)
        x, y, depth = (
            np.concatenate([getattr(few, name)[margin], getattr(nodes, name)[core]])
            for name in ("x_mm", "y_mm", "depth_mm")
        )
        count = int(margin.sum())
        beside = np.arange(x.size) < count

        def height(depth: Float64Array, stretch: float) -> float:
            relief = above_plane(x, y, depth, beside)[count:]
            return sign * float((sign * _smooth(x[count:], y[count:], relief)).max())

        figure = measure_with_errors(
            "feature_height", "mm", height, depth, errors_at(heightmap, x, y)
        )
        wide = ~around & (sign * relief > 0.5 * abs(figure.value))
        area = float(wide.sum()) * heightmap.pitch_mm**2
        diameter = 2.0 * math.sqrt(area / math.pi)
        figures = (figure, lateral_length(heightmap, "diameter", diameter))
        result = tool_result(self, figures, (self.rectangle.outline_mm,), nodes.flags)
        return _judged(result, figure, diameter)


@dataclass(frozen=True, slots=True)
class ScratchTool(SectionTool):
    """A scratch or ridge that a section crosses.

    Attributes
    ----------
    start_mm, end_mm
        The section, as in :func:`~gelpolight_core.measurement.profile.take_profile`. A fifth of its
        length at each end shows the surface beside the feature.
    """

    name = "scratch"
    palette = PaletteEntry(
        section="features",
        order=20,
        tip="Height above the surface beside it, width at half of it",
        prompts=(
            "Click the surface on one side of the scratch",
            "Click the surface on the other side",
        ),
        key="X",
    )

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure height against the surroundings, and width at half of it."""
        profile = self.section(heightmap)
        valid_mask = _complete(profile)
        along, whole = profile.along_mm[valid_mask], float(profile.along_mm[-1])
        beside = (along < SURROUNDINGS * whole) | (along > (1.0 - SURROUNDINGS) * whole)

        def relief_of(depth: Float64Array) -> Float64Array:
            return _above_line(along, depth[valid_mask], beside)

        relief = relief_of(profile.depth_mm)
        extreme = int(np.argmax(np.where(beside, 0.0, np.abs(relief))))

        def height(depth: Float64Array, stretch: float) -> float:
            return float(relief_of(depth)[extreme])

        figure = measure_with_errors(
            "feature_height", "mm", height, profile.depth_mm, profile.errors
        )
        begin, finish = _half_crossings(along, relief, extreme)
        figures = (figure, lateral_length(heightmap, "width", finish - begin))
        lines = self.line_with_part(profile, begin, finish)
        result = tool_result(self, figures, lines, profile.flags[valid_mask], profile=profile)
        return _judged(result, figure, finish - begin)


@dataclass(frozen=True, slots=True)
class EdgeRadiusTool(SectionTool):
    """The radius of a rounded edge or groove, from a section across the rounding.

    Attributes
    ----------
    start_mm, end_mm
        The section, as in :func:`~gelpolight_core.measurement.profile.take_profile`; it begins and
        ends where the rounding does.
    """

    name = "edge-radius"
    palette = PaletteEntry(
        section="features",
        order=30,
        tip="Radius, arc that the section shows",
        prompts=(
            "Click where the rounding begins",
            "Click across the edge, where the rounding ends",
        ),
        key="E",
    )

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Fit the slopes of a circle to the section: their sine is a straight line.

        Errors of slopes are nearly white, those of depths bend the section.
        """
        profile = self.section(heightmap)
        valid_mask = _complete(profile)
        along = profile.along_mm[valid_mask]

        def bend_of(depth: Float64Array, stretch: float) -> tuple[float, float]:
            """Return the bend (1/mm) and its standard deviation by what is left of the line."""
            slope = np.gradient(depth[valid_mask], stretch * along)
            fit, covariance = np.polyfit(
                stretch * along, slope / np.sqrt(1.0 + slope**2), 1, cov=True
            )
            return float(fit[0]), math.sqrt(covariance[0, 0])

        def radius(depth: Float64Array, stretch: float) -> float:
            return 1.0 / max(abs(bend_of(depth, stretch)[0]), LEAST_BEND)

        figure = measure_with_errors("radius", "mm", radius, profile.depth_mm, profile.errors)
        if figure.sd is not None:
            _, bend_sd = bend_of(profile.depth_mm, 1.0)
            figure = replace(figure, sd=math.hypot(figure.sd, figure.value**2 * bend_sd))
        circle = fit_circle(np.stack([along, profile.depth_mm[valid_mask]], axis=1))
        spread = circle.points_mm - np.array(circle.centre_mm)
        turns = np.unwrap(np.arctan2(spread[:, 1], spread[:, 0]))
        arc = math.degrees(float(np.ptp(turns)))
        figures = (
            figure,
            MeasuredValue(arc, None, "deg", "arc"),
            MeasuredValue(circle.rms_mm, None, "mm", "roundness"),
        )
        line = np.stack([self.start_mm, self.end_mm])
        result = tool_result(self, figures, (line,), profile.flags[valid_mask], profile=profile)
        if arc >= LEAST_ARC_DEG:
            return result
        text = (
            f"the section shows {arc:.0f} degrees of the arc; "
            f"at least {LEAST_ARC_DEG:.0f} are needed"
        )
        return _doubtful(result, "short_arc", text)


def _margin(nodes: AreaNodes, area: Rectangle) -> BoolArray:
    """Return which nodes lie in the margin of a rectangle."""
    along, across = area.from_centre(nodes.x_mm, nodes.y_mm)
    shares = np.abs(along) / (0.5 * area.sides_mm[0]), np.abs(across) / (0.5 * area.sides_mm[1])
    return np.asarray(np.maximum(*shares) > 1.0 - SURROUNDINGS)


def _relief_of_area(nodes: AreaNodes, around: BoolArray, area: Rectangle) -> Float64Array:
    """Return the height of nodes above the plane of the margin."""
    if min(int(around.sum()), int((~around).sum())) < LEAST_CORE:
        raise area.too_few(nodes.x_mm.size)
    return above_plane(nodes.x_mm, nodes.y_mm, nodes.depth_mm, around)


def _extreme(relief: Float64Array) -> float:
    """Return a height that at least a few nodes have."""
    return float(np.sort(relief)[-LEAST_CORE])


def _sign_of(relief: Float64Array) -> float:
    """Return 1 for a bump, -1 for a pit."""
    return 1.0 if _extreme(relief) >= _extreme(-relief) else -1.0


def _smooth(x: Float64Array, y: Float64Array, relief: Float64Array) -> Float64Array:
    """Return the least-squares surface of second order at its points."""
    u, v = x - x.mean(), y - y.mean()
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    return np.asarray(terms @ np.linalg.lstsq(terms, relief)[0])


def _above_line(along: Float64Array, depth: Float64Array, beside: BoolArray) -> Float64Array:
    slope, level = np.polyfit(along[beside], depth[beside], 1)
    return np.asarray(depth - (level + slope * along))


def _complete(profile: Profile) -> BoolArray:
    """Return which points of a section are on the map. Refuse a section that is cut off."""
    valid_mask = np.isfinite(profile.depth_mm)
    if not (valid_mask[0] and valid_mask[-1]):
        text = "the section ends outside the working area"
        raise InputError(text, f"profile of {profile.along_mm[-1]:.2f} mm", Remedy.MOVE_INSIDE)
    return valid_mask


def _half_crossings(along: Float64Array, relief: Float64Array, extreme: int) -> tuple[float, float]:
    """Return where the feature around its extreme falls to half of its height."""
    share = relief / relief[extreme] - 0.5
    ends = []
    for step in (-1, 1):
        k = extreme
        while 0 < k + step < len(share) - 1 and share[k + step] > 0.0:
            k += step
        near, far = share[k], share[k + step]
        part = near / (near - far) if near > far else 1.0
        ends.append(float(along[k] + part * (along[k + step] - along[k])))
    return ends[0], ends[1]


def _judged(result: ToolResult, height: MeasuredValue, width: float) -> ToolResult:
    """Return a result that is doubtful if nothing stands out, or if the membrane bridges it."""
    if height.sd is not None and abs(height.value) < CLEAR * height.sd:
        result = _doubtful(result, "flat", "nothing stands out from the surface around it")
    if height.value < 0.0 and width < BRIDGED * TYPICAL_DECAY_MM:
        text = (
            f"the membrane bridges a feature of {width:.2f} mm: it is at least as deep as measured"
        )
        result = _doubtful(result, "bridged", text)
    return result


def _doubtful(result: ToolResult, key: str, why: str) -> ToolResult:
    return replace(result, findings=(*result.findings, doubtful_finding(key, why)))
