"""Processing of the height map of a frozen image before it is shown and measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.view2d.quantities import Reference
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import (
    difference,
    level_by_plane,
    level_by_points,
    smooth_gaussian,
    smooth_median,
)
from gelpolight_core.reconstruction.height_map import HeightMap

Point = tuple[float, float]
LEVELLINGS = ("none", "plane", "rectangle", "points")


@dataclass(frozen=True, slots=True)
class Processing:
    """The steps, in this order: difference, levelling, filter. By default nothing is done.

    Attributes
    ----------
    reference : Reference or None
        Its depth is subtracted.
    level : str
        One of LEVELLINGS: by a plane of the untouched surface, of a rectangle, or three points.
    rectangle : Rectangle or None
        For ``rectangle``.
    points_mm : tuple of (x, y)
        For ``points``.
    filter : str
        ``none``, ``gaussian`` or ``median``.
    sigma_mm : float
        Of the Gaussian filter.
    nodes : int
        Side of the median filter, odd.
    """

    reference: Reference | None = None
    level: str = "none"
    rectangle: Rectangle | None = None
    points_mm: tuple[Point, ...] = ()
    filter: str = "none"
    sigma_mm: float = 0.1
    nodes: int = 3

    @property
    def does_nothing(self) -> bool:
        """Whether the height map stays as reconstructed."""
        return self.reference is None and self.level == "none" and self.filter == "none"


@dataclass(frozen=True, slots=True, eq=False)
class Processed:
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


def processed(heightmap: HeightMap, processing: Processing) -> Processed:
    """Process a height map: all steps, or none if one is refused."""
    if processing.does_nothing:
        return Processed(heightmap)
    try:
        done = _filtered(_levelled(_compared(heightmap, processing), processing), processing)
    except InputError as error:
        return Processed(heightmap, refused=str(error))
    return Processed(done, done.notes[len(heightmap.notes) :])


class Processor:
    """Processes height maps, and keeps the last result: a frozen image is shown many times."""

    def __init__(self) -> None:
        self._last: tuple[HeightMap, Processing, Processed] | None = None

    def __call__(self, heightmap: HeightMap, processing: Processing) -> Processed:
        """Return a height map after its processing."""
        if self._last is not None:
            before, steps, done = self._last
            if before is heightmap and steps == processing:
                return done
        done = processed(heightmap, processing)
        self._last = heightmap, processing, done
        return done


def _compared(heightmap: HeightMap, processing: Processing) -> HeightMap:
    reference = processing.reference
    return heightmap if reference is None else difference(heightmap, reference.heightmap)


def _levelled(heightmap: HeightMap, processing: Processing) -> HeightMap:
    match processing.level:
        case "plane":
            return level_by_plane(heightmap)
        case "rectangle" if processing.rectangle is not None:
            (x, y), (wide, high) = processing.rectangle.centre_mm, processing.rectangle.sides_mm
            across = np.abs(heightmap.x_mm - x) <= 0.5 * wide
            down = np.abs(heightmap.y_mm - y) <= 0.5 * high
            return level_by_plane(heightmap, mask=down[:, None] & across)
        case "points":
            return level_by_points(heightmap, processing.points_mm)
    return heightmap


def _filtered(heightmap: HeightMap, processing: Processing) -> HeightMap:
    match processing.filter:
        case "gaussian":
            return smooth_gaussian(heightmap, sigma_mm=processing.sigma_mm)
        case "median":
            return smooth_median(heightmap, nodes=processing.nodes)
    return heightmap
