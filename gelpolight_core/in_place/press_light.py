"""How the light changes in the images of the balls, by the model of every frame's light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gelpolight_core.arrays import Array, Map
from gelpolight_core.errors import InputError
from gelpolight_core.light.check import HealthCheck
from gelpolight_core.light.fit import CommonChange, Uneven
from gelpolight_core.light.limits import LEAST_UNTOUCHED
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.reconstruction.in_place.grid import WorkingGrid
from gelpolight_core.reconstruction.in_place.model import COLOUR_CELLS, ErrorCurve, InPlaceModel
from gelpolight_core.reconstruction.in_place.terms import TERMS
from gelpolight_core.reflectance.contour import Circle

PressLights = Mapping[str, tuple[CommonChange, Uneven | None]]


@dataclass(frozen=True, slots=True)
class PressImage:
    """An image of a pressed ball.

    Attributes
    ----------
    name : str
        Its file.
    rgb : (height, width, 3) float32
        Linear light.
    radius_mm : float
        Of the ball.
    placed : Circle or None
        Contact drawn by hand, camera pixels.
    """

    name: str
    rgb: Map
    radius_mm: float
    placed: Circle | None = None


def press_lights(
    presses: Sequence[PressImage], grid: WorkingGrid, background: Map, noise: Array
) -> PressLights:
    """Return the change of light in each image of a pressed ball, by its name.

    Parameters
    ----------
    presses : sequence of PressImage
        The images.
    grid : WorkingGrid
        Nodes and scale.
    background : (rows, columns, 3) float32
        The untouched membrane on the grid.
    noise : (3,)
        Standard deviation of a pixel of a single image.

    Raises
    ------
    InputError
        If the background does not show the membrane around the balls: it is of another gel, crop
        or sensor.
    """
    colours = np.zeros((COLOUR_CELLS,) * 3, np.float32)
    errors = ErrorCurve(np.arange(2.0), np.zeros(2), 0.0, 0.0)
    bare = InPlaceModel(grid, background, np.zeros((TERMS, 2)), colours, 0.0, errors)
    check = HealthCheck(ClosedSensor("", bare, noise, ()))
    found = {press.name: check.change(press.rgb) for press in presses}
    untouched = float(np.median([common.share for common, _ in found.values()]))
    if untouched < LEAST_UNTOUCHED:
        raise InputError(
            f"the background looks like {100.0 * untouched:.0f} % of the membrane around the balls",
            "background",
            "Use a background of the same gel, crop, size and exposure as the ball images",
        )
    return found
