"""The scatter of ball pixels behind a reflectance table, gathered from the session when needed.

A run does not keep it: it is a million numbers that can be computed from the session's images.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.reflectance.stage import ball_scatter
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class ReflectanceScatter:
    """Ball pixels as used by the reflectance table, for each channel.

    Attributes
    ----------
    cosines, values : tuple of 3 (N,) arrays
        cos(theta) from the ball's normals, and processed pixel values I / (rho |L|).
    presses : tuple of 3 (N,) int arrays
        Index in `names` of the press of each pixel.
    names : tuple of str
        Image names of the presses.
    """

    cosines: tuple[Array, Array, Array]
    values: tuple[Array, Array, Array]
    presses: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]
    names: tuple[str, ...]


def gather_scatter(
    run: CalibrationRun, session: Session, *, progress: Progress | None = None
) -> ReflectanceScatter:
    """Gather the scatter of a run's ball presses, with the factors fed back (section V-E).

    Parameters
    ----------
    run : CalibrationRun
        Made from `session`.
    session : Session
        The session with the ball images.
    progress : callable, optional
        Called with the press name and the share done, 0..1.

    Raises
    ------
    InputError
        If a ball image can no longer be read.
    """
    progress = progress or (lambda _name, _share: None)
    table = run.calibration.table
    presses = run.reflectance.presses
    parts: list[list[tuple[Array, Array, NDArray[np.intp]]]] = [[], [], []]
    for index, press in enumerate(presses):
        progress(press.name, index / len(presses))
        image = table.apply(
            read_image(session.folder / press.name, response=run.calibration.response).rgb
        )
        scatter = ball_scatter(
            [press],
            [image],
            table,
            run.lights.led_positions_mm,
            run.radiance,
            run.factors.factors,
        )
        for part, (cosines, values) in zip(parts, scatter, strict=True):
            part.append((cosines, values, np.full(cosines.size, index)))
    red, green, blue = (
        tuple(np.concatenate(column) for column in zip(*p, strict=True)) for p in parts
    )
    return ReflectanceScatter(
        (red[0], green[0], blue[0]),
        (red[1], green[1], blue[1]),
        (red[2], green[2], blue[2]),
        tuple(press.name for press in presses),
    )
