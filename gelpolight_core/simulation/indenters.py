"""Objects pressed into the virtual sensor, and the resulting membrane surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .design_parts import MembraneDesign
from .drape import NOWHERE_MM, contact_radius, free_profile, solve_drape
from .pressed_surface import PressedSurface
from .sensor_design import SensorDesign
from .simulation_kernel import Interrupt, never_interrupt

PITCH_MM = 0.025
"""Default cell size of a pressed surface: one pixel of the default sensor's image."""

_FLAT = MembraneDesign()

MARGIN_DECAYS = 8.0
"""Margin around an indenter in decay lengths: the depth falls to exp(-8) of its value at the edge.
"""


def image_pitch_mm(design: SensorDesign) -> float:
    """Return the cell size of a surface as fine as the image shows it."""
    return max(PITCH_MM, 0.7 * design.layers.top_distance_mm / design.camera.fx)


@dataclass(frozen=True, slots=True)
class BallIndenter:
    """A ball whose lowest point is `depth_mm` deep."""

    radius_mm: float
    depth_mm: float

    @property
    def reach_mm(self) -> float:
        """Radius of the circle that contains the possible contact."""
        rest = max(self.radius_mm - self.depth_mm, 0.0)
        return math.sqrt(self.radius_mm**2 - rest**2)

    def profile(self, radius_mm: float) -> tuple[float, float]:
        """Return (depth, decrease per mm) at a distance from the axis."""
        root = math.sqrt(max(self.radius_mm**2 - radius_mm**2, 1e-300))
        return self.depth_mm - self.radius_mm + root, radius_mm / root

    def obstacle(self, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return the ball's depth at points around its axis.

        Parameters
        ----------
        x_mm, y_mm : (...)
            Relative to its centre, before rotation.
        """
        inside = self.radius_mm**2 - x_mm**2 - y_mm**2
        root = np.sqrt(np.maximum(inside, 0.0))
        return np.where(inside > 0.0, self.depth_mm - self.radius_mm + root, NOWHERE_MM)


@dataclass(frozen=True, slots=True)
class CylinderIndenter:
    """A flat-faced cylinder with a rounded edge."""

    diameter_mm: float
    depth_mm: float
    edge_radius_mm: float = 0.05

    @property
    def reach_mm(self) -> float:
        """Radius of the cylinder."""
        return 0.5 * self.diameter_mm

    def profile(self, radius_mm: float) -> tuple[float, float]:
        """Return (depth, decrease per mm) at a distance from the axis."""
        drop, fall = _rounding(np.array(self.reach_mm - radius_mm), self.edge_radius_mm)
        return self.depth_mm - float(drop), float(fall)

    def obstacle(self, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return the cylinder's depth at points around its axis.

        Parameters
        ----------
        x_mm, y_mm : (...)
            Relative to its centre, before rotation.
        """
        inside = self.reach_mm - np.hypot(x_mm, y_mm)
        drop, _ = _rounding(inside, self.edge_radius_mm)
        return np.where(inside >= 0.0, self.depth_mm - drop, NOWHERE_MM)


@dataclass(frozen=True, slots=True)
class CuboidIndenter:
    """A flat-faced square block with rounded edges."""

    side_mm: float
    depth_mm: float
    edge_radius_mm: float = 0.05

    @property
    def reach_mm(self) -> float:
        """Half the side."""
        return 0.5 * self.side_mm

    def obstacle(self, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return the block's depth in its own frame.

        Parameters
        ----------
        x_mm, y_mm : (...)
            Relative to its centre, before rotation.
        """
        inside = self.reach_mm - np.maximum(np.abs(x_mm), np.abs(y_mm))
        drop, _ = _rounding(inside, self.edge_radius_mm)
        return np.where(inside >= -1e-9, self.depth_mm - drop, NOWHERE_MM)


@dataclass(frozen=True, slots=True)
class ReliefIndenter:
    """A shape given by heights, pressed until its highest point is `depth_mm` deep.

    Attributes
    ----------
    height_mm : (rows, columns)
        Height above the base; NaN without material.
    pitch_mm : float
        Grid spacing of the heights.
    depth_mm : float
        Depth of the highest point.
    """

    height_mm: Float64Array
    pitch_mm: float
    depth_mm: float

    @property
    def reach_mm(self) -> float:
        """Half the longer side."""
        return 0.5 * self.pitch_mm * float(max(self.height_mm.shape) - 1)

    def obstacle(self, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
        """Return the relief's depth around its centre.

        Parameters
        ----------
        x_mm, y_mm : (...)
            Relative to its centre, before rotation.
        """
        rows, columns = self.height_mm.shape
        position = [
            y_mm / self.pitch_mm + 0.5 * (rows - 1),
            x_mm / self.pitch_mm + 0.5 * (columns - 1),
        ]
        missing = np.isnan(self.height_mm)
        filled = np.where(missing, 0.0, self.height_mm)
        height = map_coordinates(filled, position, order=1, mode="constant", cval=0.0)
        gap = map_coordinates(missing.astype(float), position, order=1, mode="constant", cval=1.0)
        depth = height - float(np.nanmax(self.height_mm)) + self.depth_mm
        return np.where(gap > 1e-6, NOWHERE_MM, depth)


Indenter = BallIndenter | CylinderIndenter | CuboidIndenter | ReliefIndenter


def _rounding(inside_mm: Float64Array, edge_mm: float) -> tuple[Float64Array, Float64Array]:
    """Return the drop of a rounded edge at a distance inside the outline with its slope."""
    if edge_mm <= 0.0:
        return np.zeros_like(inside_mm), np.zeros_like(inside_mm)
    offset = np.clip(edge_mm - inside_mm, 0.0, edge_mm)
    root = np.sqrt(edge_mm**2 - offset**2)
    return edge_mm - root, offset / np.maximum(root, 1e-12)


def press_surface(
    indenter: Indenter,
    *,
    x_mm: float = 0.0,
    y_mm: float = 0.0,
    yaw_deg: float = 0.0,
    decay_mm: float = 0.7,
    rest: MembraneDesign = _FLAT,
    pitch_mm: float = PITCH_MM,
    interrupt: Interrupt = never_interrupt,
) -> PressedSurface:
    """Return the membrane's surface under an indenter.

    On a flat membrane, an axisymmetric shape is solved in closed form; any other on a grid in its
    own frame, which is then rotated. A shape stays upright on a curved membrane, and its depth is
    the indentation at its axis.

    Parameters
    ----------
    indenter : BallIndenter, CylinderIndenter, CuboidIndenter or ReliefIndenter
        The pressed object.
    x_mm, y_mm, yaw_deg : float, optional
        Position, and rotation (from x to y).
    decay_mm : float, optional
        Decay length of the membrane.
    rest : MembraneDesign, optional
        The membrane, of which the shape at rest is used.
    pitch_mm : float, optional
        Cell size of the surface.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.
    """
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    turned = not isinstance(indenter, (BallIndenter, CylinderIndenter))
    reach_mm = indenter.reach_mm * (abs(cos) + abs(sin) if turned else 1.0)
    half = reach_mm + MARGIN_DECAYS * decay_mm
    xs, ys = _cells(x_mm, half, pitch_mm), _cells(y_mm, half, pitch_mm)
    dx, dy = np.meshgrid(xs - x_mm, ys - y_mm)
    if isinstance(indenter, (BallIndenter, CylinderIndenter)) and rest.apex_height_mm == 0.0:
        depth, contact = _round_drape(indenter, np.hypot(dx, dy), decay_mm)
    else:
        x0, y0 = x_mm - rest.axis_mm[0], y_mm - rest.axis_mm[1]

        def obstacle(along: Float64Array, across: Float64Array) -> Float64Array:
            x, y = x0 + along * cos - across * sin, y0 + along * sin + across * cos
            height = rest.height_mm(np.hypot(x, y)) - rest.height_mm(np.hypot(x0, y0))
            return indenter.obstacle(along, across) + height

        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        depth, contact = _turned_drape(
            indenter, obstacle, along, across, decay_mm, pitch_mm, interrupt
        )
    return PressedSurface(depth, contact, float(xs[0]), float(ys[0]), pitch_mm)


def _cells(middle: float, half: float, pitch: float) -> Float64Array:
    """Return cells at whole multiples of the pitch, so that all surfaces share one lattice."""
    first, last = math.floor((middle - half) / pitch), math.ceil((middle + half) / pitch)
    return pitch * np.arange(first, last + 1, dtype=np.float64)


def _round_drape(
    indenter: BallIndenter | CylinderIndenter, radius: Float64Array, decay_mm: float
) -> tuple[Float64Array, BoolArray]:
    if indenter.depth_mm <= 0.0:
        return np.zeros_like(radius), np.zeros(radius.shape, dtype=np.bool_)
    contact_mm = contact_radius(indenter.profile, indenter.reach_mm, decay_mm)
    contact = radius <= contact_mm
    edge_depth, _ = indenter.profile(contact_mm)
    outside = free_profile(np.maximum(radius, contact_mm), contact_mm, edge_depth, decay_mm)
    zeros = np.zeros_like(radius)
    return np.where(contact, indenter.obstacle(radius, zeros), outside), contact


def _turned_drape(
    indenter: Indenter,
    obstacle: Callable[[Float64Array, Float64Array], Float64Array],
    along: Float64Array,
    across: Float64Array,
    decay_mm: float,
    pitch_mm: float,
    interrupt: Interrupt,
) -> tuple[Float64Array, BoolArray]:
    """Solve the membrane in the indenter's own frame, and read it at rotated positions."""
    half = indenter.reach_mm + MARGIN_DECAYS * decay_mm
    # The outline lies on cells, so that the block has its nominal side.
    count = math.ceil(half / pitch_mm)
    step = indenter.reach_mm / max(1, round(indenter.reach_mm / pitch_mm)) or pitch_mm
    cells = step * np.arange(-count, count + 1, dtype=np.float64)
    depth, contact = solve_drape(obstacle, cells, cells, decay_mm=decay_mm, interrupt=interrupt)
    position = [across / step + count, along / step + count]
    turned = map_coordinates(depth, position, order=3, mode="constant", cval=0.0, prefilter=True)
    touched = map_coordinates(contact.astype(np.float64), position, order=1, cval=0.0) > 0.5
    return np.clip(turned, 0.0, max(indenter.depth_mm, float(depth.max()))), touched


def _heights(
    half_mm: float, height: Callable[[Float64Array, Float64Array], Float64Array]
) -> Float64Array:
    count = math.ceil(half_mm / PITCH_MM)
    cells = PITCH_MM * np.arange(-count, count + 1)
    return height(*np.meshgrid(cells, cells))


def _ramp(inside_mm: Float64Array, width_mm: float) -> Float64Array:
    """Return 0 outside, 1 inside, with a smooth flank of a given width."""
    t = np.clip(inside_mm / width_mm + 0.5, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def coin(diameter_mm: float, depth_mm: float) -> ReliefIndenter:
    """Return a coin with a raised rim, a ring of beads and a six-petalled flower.

    Parameters
    ----------
    diameter_mm : float
        Diameter of the coin.
    depth_mm : float
        Depth of its highest point when pressed.
    """
    radius = 0.5 * diameter_mm
    flank = 0.02 * diameter_mm

    def height(x: Float64Array, y: Float64Array) -> Float64Array:
        r, angle = np.hypot(x, y), np.arctan2(y, x)
        rim = _ramp(r - 0.88 * radius, flank)
        petals = radius * (0.32 + 0.16 * np.cos(6.0 * angle))
        flower = _ramp(petals - r, flank) * (0.7 + 0.3 * np.cos(math.pi * r / radius))
        turn = np.mod(angle, math.radians(15.0)) - math.radians(7.5)
        bead = np.hypot(r * np.cos(turn) - 0.72 * radius, r * np.sin(turn))
        beads = np.sqrt(np.clip(1.0 - (bead / (0.045 * radius)) ** 2, 0.0, None))
        relief = 0.45 + 0.15 * np.maximum(np.maximum(rim, flower), 0.7 * beads)
        return np.where(r <= radius, relief, np.nan)

    return ReliefIndenter(_heights(radius, height), PITCH_MM, depth_mm)


def nut(across_flats_mm: float, depth_mm: float) -> ReliefIndenter:
    """Return a hexagonal nut with a bevelled crown and a countersunk hole.

    Parameters
    ----------
    across_flats_mm : float
        Width between opposite sides.
    depth_mm : float
        As for :func:`coin`.
    """
    flat = 0.5 * across_flats_mm
    hole = 0.55 * flat

    def height(x: Float64Array, y: Float64Array) -> Float64Array:
        r, angle = np.hypot(x, y), np.arctan2(y, x)
        turn = np.mod(angle, math.radians(60.0)) - math.radians(30.0)
        inside = flat - r * np.cos(turn)
        # The crown has a bevel of 30 degrees to the face, the countersink 45 degrees.
        crown = math.tan(math.radians(30.0)) * np.clip(r - 0.95 * flat, 0.0, None)
        sink = np.clip(1.15 * hole - r, 0.0, None)
        return np.where((inside >= 0.0) & (r >= hole), 1.0 - crown - sink, np.nan)

    return ReliefIndenter(_heights(1.16 * flat, height), PITCH_MM, depth_mm)
