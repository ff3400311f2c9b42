"""Processing of the height map of a frozen image before it is shown and measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.view2d.quantities import Reference
from gelpolight_core.errors import InputError
from gelpolight_core.fields import choice, number
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import (
    LARGEST_MEDIAN,
    difference,
    level_by_plane,
    level_by_points,
    masked,
    smooth_gaussian,
    smooth_median,
    surface_itself,
)
from gelpolight_core.reconstruction.height_map import HeightMap

Point = tuple[float, float]
MM = " mm"
MASKS = {
    "none": "none",
    "inside": "keep the rectangle",
    "outside": "leave out the rectangle",
    "deeper": "keep deeper points",
    "sure": "leave out flagged points",
}
ABOUT_MASK = (
    "Keep a part of the points only. The others have no depth, and are left out of levelling, "
    "filter, histogram and export"
)
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
FILTERS = {"none": "none", "gaussian": "Gaussian", "median": "median"}
ABOUT_FILTER = "Smooth the height map. The uncertainty of a smoothed map is not known"


@dataclass(frozen=True, slots=True)
class Processing:
    """The steps, in this order: difference, mask, levelling, filter. By default nothing is done.

    Attributes
    ----------
    reference : Reference or None
        Its depth is subtracted.
    mask : str
        What is kept: the inside or outside of the rectangle, points that are deeper
        than a limit, or points without a flag.
    deeper_mm : float
        The limit for ``deeper``.
    level : str
        By a plane of the untouched surface, of a rectangle, or three points.
    rectangle : Rectangle or None
        For mask and levelling, if they need it.
    points_mm : tuple of (x, y)
        For ``points``.
    filter : str
        ``none``, ``gaussian`` or ``median``.
    sigma_mm : float
        Of the Gaussian filter.
    nodes : int
        Side of the median filter, odd.
    """

    mask: str = choice("none", "Mask", MASKS, ABOUT_MASK)
    deeper_mm: float = number(
        0.1, "Deeper than", -5.0, 5.0, MM, 3, step=0.05, when=lambda p: p.mask == "deeper"
    )
    level: str = choice("none", "Levelling", LEVELS, ABOUT_LEVEL)
    filter: str = choice("none", "Filter", FILTERS, ABOUT_FILTER)
    sigma_mm: float = number(
        0.1, "Sigma", 0.01, 2.0, MM, 2, step=0.05, when=lambda p: p.filter == "gaussian"
    )
    nodes: int = number(
        3, "Size", 3, LARGEST_MEDIAN, " points", step=2, when=lambda p: p.filter == "median"
    )
    reference: Reference | None = None
    rectangle: Rectangle | None = None
    points_mm: tuple[Point, ...] = ()

    @property
    def uses_rectangle(self) -> bool:
        """Whether mask or levelling need the rectangle."""
        return self.level == "rectangle" or self.mask in ("inside", "outside")

    @property
    def does_nothing(self) -> bool:
        """Whether the height map stays as reconstructed."""
        return self.reference is None and {self.mask, self.level, self.filter} == {"none"}


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
        done = heightmap
        for step in (_compared, _masked, _levelled, _filtered):
            done = step(done, processing)
    except InputError as error:
        return Processed(heightmap, refused=str(error))
    return Processed(done, tuple(step.text for step in done.findings[len(heightmap.findings) :]))


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


def _masked(heightmap: HeightMap, processing: Processing) -> HeightMap:
    match processing.mask:
        case "inside" if processing.rectangle is not None:
            return masked(heightmap, _inside(heightmap, processing.rectangle))
        case "outside" if processing.rectangle is not None:
            return masked(heightmap, ~_inside(heightmap, processing.rectangle))
        case "deeper":
            return masked(heightmap, heightmap.depth_mm > processing.deeper_mm)
        case "sure":
            return masked(heightmap, heightmap.flags == 0)
    return heightmap


def _inside(heightmap: HeightMap, rectangle: Rectangle) -> NDArray[np.bool_]:
    x_mm, y_mm = (np.asarray(v, np.float64) for v in (heightmap.x_mm, heightmap.y_mm))
    along, across = rectangle.from_centre(x_mm, y_mm[:, None])
    first, second = rectangle.sides_mm
    return np.asarray((np.abs(along) <= 0.5 * first) & (np.abs(across) <= 0.5 * second))


def _levelled(heightmap: HeightMap, processing: Processing) -> HeightMap:
    match processing.level:
        case "plane":
            return level_by_plane(heightmap)
        case "rectangle" if processing.rectangle is not None:
            return level_by_plane(heightmap, mask=_inside(heightmap, processing.rectangle))
        case "points":
            return level_by_points(heightmap, processing.points_mm)
        case "surface":
            return surface_itself(heightmap)
    return heightmap


def _filtered(heightmap: HeightMap, processing: Processing) -> HeightMap:
    match processing.filter:
        case "gaussian":
            return smooth_gaussian(heightmap, sigma_mm=processing.sigma_mm)
        case "median":
            return smooth_median(heightmap, nodes=processing.nodes)
    return heightmap
