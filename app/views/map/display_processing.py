"""Processing of the height map of a frozen image before it is shown and measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.form_fields import choice
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import (
    depth_below_boundary_plane,
    level_by_plane,
    level_by_points,
    subtract_map,
)
from gelpolight_core.reconstruction.height_map import HeightMap

from .quantities import ReferenceMap

LEVELS = {
    "none": "none",
    "plane": "plane",
    "rectangle": "plane of the rectangle",
    "points": "three points",
    "surface": "none, the curved surface itself",
}
ABOUT_LEVEL = (
    "Subtract a plane: of the untouched surface (pressed objects are left out), of the rectangle "
    "on the map, or through three points on the map. Of a curved membrane, the surface itself can "
    "be shown and measured, in place of its indentation"
)


@dataclass(frozen=True, slots=True)
class ProcessingSteps:
    """The steps: first the difference, then levelling. By default nothing is done.

    Attributes
    ----------
    reference : ReferenceMap or None
        Its depth is subtracted.
    level : str
        By a plane of the untouched surface, of a rectangle, or three points.
    rectangle : Rectangle or None
        For ``rectangle``.
    points_mm : tuple of (x, y)
        For ``points``.
    """

    level: str = choice("none", "Levelling", LEVELS, ABOUT_LEVEL)
    reference: ReferenceMap | None = None
    rectangle: Rectangle | None = None
    points_mm: tuple[PointXY, ...] = ()

    @property
    def does_nothing(self) -> bool:
        """Whether the height map stays as reconstructed."""
        return self.reference is None and self.level == "none"


@dataclass(frozen=True, slots=True, eq=False)
class ProcessedMap:
    """A height map after its processing.

    Attributes
    ----------
    heightmap : HeightMap
        As reconstructed if nothing was done.
    steps : tuple of str
        Sentences that say what was done.
    refused : str
        Why it could not be done; the height map is then as reconstructed.
    """

    heightmap: HeightMap
    steps: tuple[str, ...] = ()
    refused: str = ""


def process_map(heightmap: HeightMap, processing: ProcessingSteps) -> ProcessedMap:
    """Process a height map: all steps, or none if one is refused."""
    if processing.does_nothing:
        return ProcessedMap(heightmap)
    try:
        reference = processing.reference
        done = heightmap if reference is None else subtract_map(heightmap, reference.heightmap)
        done = _levelled(done, processing)
    except InputError as error:
        return ProcessedMap(heightmap, refused=str(error))
    return ProcessedMap(done, tuple(step.text for step in done.findings[len(heightmap.findings) :]))


class MapProcessor:
    """Processes height maps, and keeps the last result: a frozen image is shown many times."""

    def __init__(self) -> None:
        self._last: tuple[HeightMap, ProcessingSteps, ProcessedMap] | None = None

    def __call__(self, heightmap: HeightMap, processing: ProcessingSteps) -> ProcessedMap:
        """Return a height map after its processing."""
        if self._last is not None:
            before, steps, done = self._last
            if before is heightmap and steps == processing:
                return done
        done = process_map(heightmap, processing)
        self._last = heightmap, processing, done
        return done


def _inside(heightmap: HeightMap, rectangle: Rectangle) -> NDArray[np.bool_]:
    x_mm, y_mm = (np.asarray(v, np.float64) for v in (heightmap.x_mm, heightmap.y_mm))
    along, across = rectangle.from_centre(x_mm, y_mm[:, None])
    first, second = rectangle.sides_mm
    return np.asarray((np.abs(along) <= 0.5 * first) & (np.abs(across) <= 0.5 * second))


def _levelled(heightmap: HeightMap, processing: ProcessingSteps) -> HeightMap:
    match processing.level:
        case "plane":
            return level_by_plane(heightmap)
        case "rectangle" if processing.rectangle is not None:
            return level_by_plane(heightmap, mask=_inside(heightmap, processing.rectangle))
        case "points":
            return level_by_points(heightmap, processing.points_mm)
        case "surface":
            return depth_below_boundary_plane(heightmap)
    return heightmap
