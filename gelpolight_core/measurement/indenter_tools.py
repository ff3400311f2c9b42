"""The fitted indenters as measuring tools: ball, cylinder and cuboid."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.measurement.measure import PressedMap, measure_object, pressed_map
from gelpolight_core.measurement.proposal import propose
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.spread import MODE_ERRORS, ModeError
from gelpolight_core.measurement.tool import Point, Tool, ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.modes import Mode
from gelpolight_core.reconstruction.near_light.contact import MARGIN_DECAYS

AUTO = "auto"
"""The value for automatic selection of the shape."""
PIXEL = 1.0 / 12.0
"""Variance of a pixel's own width, which the blur of the board's edges contains in part."""


def measure_heightmap(
    heightmap: HeightMap,
    *,
    shape: str,
    seed_mm: Point | None = None,
    edge_radius_mm: float | None = None,
    edge_radius_sd_mm: float | None = None,
) -> Measurement:
    """Measure the pressed object with all data of a height map.

    Parameters
    ----------
    heightmap : HeightMap
        Reconstructed with its uncertainty if the result shall contain noise and calibration.
    shape : {"auto", "ball", "cylinder", "cuboid"}
        What is pressed; ``auto`` fits all three.
    seed_mm : (float, float), optional
        A point (x, y) on the object; needed where several objects are pressed.
    edge_radius_mm : float, optional
        Stated fillet of the edge of a cylinder or cuboid; by default it is fitted.
    edge_radius_sd_mm : float, optional
        Its standard uncertainty.

    Raises
    ------
    InputError
        As :func:`~gelpolight_core.measurement.measure.measure_object`, or the shape is unclear. If
        the height map is doubtful, the reason comes first: it may be why nothing was found.
    """
    try:
        pressed = pressed_map(heightmap)
        if shape == AUTO:
            shape = _found_shape(heightmap, seed_mm, pressed)
        mode, reach_mm = mode_error(heightmap), TYPICAL_DECAY_MM
        return measure_object(
            heightmap,
            shape=shape,
            seed_mm=seed_mm,
            mode=mode,
            reach_mm=reach_mm,
            edge_radius_mm=edge_radius_mm,
            edge_radius_sd_mm=edge_radius_sd_mm,
            pressed=pressed,
        )
    except InputError as error:
        for doubt in heightmap.doubts:
            found = f"{doubt.text}; {error.found}"
            raise InputError(found, error.where, doubt.remedy or error.advice) from error
        raise


def _found_shape(heightmap: HeightMap, seed_mm: Point | None, pressed: PressedMap) -> str:
    """Return the shape that is pressed."""
    proposal = propose(heightmap, seed_mm=seed_mm, pressed=pressed)
    if proposal is not None and len(proposal.candidates) == 1:
        return proposal.candidates[0]
    if proposal is None:
        found = "no ball, cylinder or cuboid is pressed"
    else:
        found = f"the object may be a {proposal.candidates[0]} or a {proposal.candidates[1]}"
    raise InputError(found, heightmap.source or "height map", Remedy.CHOOSE_SHAPE)


def mode_error(heightmap: HeightMap) -> ModeError:
    """Return the remaining error of the model and effort of a height map.

    Parameters
    ----------
    heightmap : HeightMap
        If it does not state its effort, the fastest is assumed.
    """
    effort = "fast" if heightmap.trace is None else heightmap.trace.effort
    found = MODE_ERRORS[Mode(heightmap.model, effort)]
    node_mm = heightmap.pitch_mm * found.node_mm
    blur_mm2, blur_sd = node_mm**2 / 3.0, 1.0
    if heightmap.image_blur_mm is not None:
        blur_mm2 += heightmap.image_blur_mm**2
        # An image's blur may differ from the board's by 0.1 px, by 0.03 on sensors of known blur.
        blur_sd = math.hypot(PIXEL, 0.2 * heightmap.image_blur_mm / heightmap.pitch_mm)
    # Beyond its margin, the drape may have any depth up to what is left of the smallest visible
    # one; the ground around an object is fitted with it.
    hidden_mm = math.exp(-MARGIN_DECAYS) * (heightmap.visible_depth_mm or 0.0)
    return replace(
        found,
        lateral_per_mm=heightmap.lateral_per_mm,
        node_mm=node_mm,
        blur_mm2=found.blur_mm2 * blur_mm2,
        blur_sd_mm2=found.blur_mm2 * blur_sd * heightmap.pitch_mm**2,
        smoothed_mm2=found.smoothed_mm2 * node_mm**2,
        level_mm=hidden_mm / math.sqrt(12.0),
    )


@dataclass(frozen=True, slots=True)
class FittedIndenter(Tool):
    """An indenter, fitted with the drape around it.

    Attributes
    ----------
    at_mm : (float, float) or None
        A point on it; None where nothing else is pressed.
    edge_radius_mm, edge_radius_sd_mm : float or None
        Stated fillet of its edge and its standard uncertainty; None: fitted. A ball has none.
    """

    name: ClassVar[str]
    at_mm: Point | None = None
    edge_radius_mm: float | None = None
    edge_radius_sd_mm: float | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        fit = measure_heightmap(
            heightmap,
            shape=self.name,
            seed_mm=self.at_mm,
            edge_radius_mm=self.edge_radius_mm,
            edge_radius_sd_mm=self.edge_radius_sd_mm,
        )
        return _fitted(self, fit)

    def with_edge(self, radius_mm: float | None, sd_mm: float | None) -> Tool:
        """Return it with a stated edge."""
        return replace(self, edge_radius_mm=radius_mm, edge_radius_sd_mm=sd_mm)


class Ball(FittedIndenter):
    """A ball; attributes as for :class:`FittedIndenter`."""

    name = "ball"


class Cylinder(FittedIndenter):
    """A flat cylinder; attributes as for :class:`FittedIndenter`."""

    name = "cylinder"


class Cuboid(FittedIndenter):
    """A flat cuboid; attributes as for :class:`FittedIndenter`."""

    name = "cuboid"


def _fitted(tool: FittedIndenter, fit: Measurement) -> ToolResult:
    """Return a fit as a tool's result."""
    return ToolResult(tool, fit.figures, (fit.outline_mm,), fit.findings, measurement=fit)
