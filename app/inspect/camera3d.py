"""The camera of the 3D view: it goes round the surface and never rolls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

PRESETS = {
    "oblique": (-28.0, 42.0),
    "top": (0.0, 90.0),
    "front": (0.0, 12.0),
    "side": (90.0, 12.0),
}
"""(azimuth, elevation) in degrees; seen from the lower edge of the picture at azimuth 0."""

VIEW_ANGLE_DEG = 26.0
MARGIN = 1.06


@dataclass(frozen=True, slots=True)
class Camera:
    """Where the surface is seen from.

    The scene's frame has x to the right and y up in the camera's picture, z towards the viewer.

    Attributes
    ----------
    azimuth_deg, elevation_deg : float
        Direction from which it looks; elevation 90 is from above.
    distance_mm : float
        To what it looks at.
    focus : (x, y, z)
        What it looks at, mm.
    view_angle_deg : float
        Of the height of the picture.
    """

    azimuth_deg: float = PRESETS["oblique"][0]
    elevation_deg: float = PRESETS["oblique"][1]
    distance_mm: float = 60.0
    focus: tuple[float, float, float] = (0.0, 0.0, 0.0)
    view_angle_deg: float = VIEW_ANGLE_DEG

    def backward(self) -> NDArray[np.float64]:
        """Return the unit vector from what it looks at to the camera."""
        azimuth, elevation = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        across = math.cos(elevation)
        return np.array(
            [across * math.sin(azimuth), -across * math.cos(azimuth), math.sin(elevation)]
        )

    def up(self) -> NDArray[np.float64]:
        """Return the unit vector that is upright in the picture."""
        azimuth, elevation = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        tilt = math.sin(elevation)
        return np.array([-tilt * math.sin(azimuth), tilt * math.cos(azimuth), math.cos(elevation)])

    def right(self) -> NDArray[np.float64]:
        """Return the unit vector to the right in the picture."""
        azimuth = math.radians(self.azimuth_deg)
        return np.array([math.cos(azimuth), math.sin(azimuth), 0.0])

    def position(self) -> NDArray[np.float64]:
        """Return where it stands, mm."""
        return np.asarray(self.focus) + self.distance_mm * self.backward()

    def clipping(self) -> tuple[float, float]:
        """Return the nearest and farthest distance that is drawn, mm; alike for all frames."""
        return 0.02 * self.distance_mm, 4.0 * self.distance_mm + 100.0

    def turned(self, azimuth_deg: float, elevation_deg: float) -> Camera:
        """Return it gone round by so much."""
        elevation = min(max(self.elevation_deg + elevation_deg, -5.0), 90.0)
        azimuth = math.remainder(self.azimuth_deg + azimuth_deg, 360.0)
        return replace(self, azimuth_deg=azimuth, elevation_deg=elevation)

    def zoomed(self, factor: float) -> Camera:
        """Return it nearer (above 1) or farther."""
        return replace(self, distance_mm=min(max(self.distance_mm / factor, 2.0), 500.0))

    def panned(self, right_px: float, down_px: float, height_px: int) -> Camera:
        """Return it moved so that the surface follows the pointer."""
        step = self.mm_per_px(height_px)
        focus = np.asarray(self.focus) + step * (down_px * self.up() - right_px * self.right())
        return replace(self, focus=tuple(float(v) for v in focus))

    def mm_per_px(self, height_px: int) -> float:
        """Return the size of a pixel at what it looks at."""
        return (
            2.0 * self.distance_mm * math.tan(math.radians(0.5 * self.view_angle_deg)) / height_px
        )

    def seen_from(self, azimuth_deg: float, elevation_deg: float) -> Camera:
        """Return it elsewhere, looking at the same."""
        return replace(self, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)

    def fitted(self, radius_mm: float, size: tuple[int, int]) -> Camera:
        """Return it at the distance from which a disc about the middle is seen as a whole."""
        half = math.tan(math.radians(0.5 * self.view_angle_deg))
        aspect = size[0] / max(size[1], 1)
        tilt = math.sin(math.radians(self.elevation_deg))
        lean = math.cos(math.radians(self.elevation_deg))
        # The near edge of the disc is nearer by its lean, and looks wider.
        high = radius_mm * (abs(tilt) / half + lean)
        wide = radius_mm * (1.0 / (half * aspect) + 0.35 * lean)
        return replace(self, distance_mm=MARGIN * max(high, wide), focus=(0.0, 0.0, 0.0))

    def project(self, points_mm: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
        """Return where points (N, 3) of the scene are seen, (N, 2) pixels from the upper left."""
        away = np.asarray(points_mm, np.float64) - self.position()
        depth = -(away @ self.backward())
        scale = 0.5 * size[1] / math.tan(math.radians(0.5 * self.view_angle_deg))
        across = 0.5 * size[0] + scale * (away @ self.right()) / depth
        down = 0.5 * size[1] - scale * (away @ self.up()) / depth
        return np.stack([across, down], axis=-1)

    def ray(
        self, across: float, down: float, size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position and unit direction of the ray through a pixel."""
        scale = math.tan(math.radians(0.5 * self.view_angle_deg)) / (0.5 * size[1])
        direction = (
            -self.backward()
            + (across - 0.5 * size[0]) * scale * self.right()
            - (down - 0.5 * size[1]) * scale * self.up()
        )
        return self.position(), direction / np.linalg.norm(direction)
