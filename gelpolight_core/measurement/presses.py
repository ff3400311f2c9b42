"""Images of presses for the evaluation: read, measured, and named for a ledger."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core import __version__
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_image, require_colour


def press_measurement(reconstructor: Reconstructor) -> Callable[[Path, str], Measurement]:
    """Return the function that measures the object of a given shape in an image file.

    Parameters
    ----------
    reconstructor : Reconstructor
        With the calibration under test, whose verdict is part of the measurement's.
    """
    calibration = reconstructor.calibration

    def measure(path: Path, shape: str) -> Measurement:
        image = read_image(path, response=calibration.response)
        require_colour(image, where=str(path))
        heightmap = measurable_depth(reconstructor, image.rgb, name=path.name, where=str(path))
        return judged(measure_heightmap(heightmap, shape=shape), heightmap)

    return measure


def open_ledger(path: Path | None, reconstructor: Reconstructor) -> Ledger:
    """Return the ledger of measurements with a calibration, a model and this program.

    Parameters
    ----------
    path : Path or None
        Its file; None: it is kept in memory only.
    reconstructor : Reconstructor
        What the measurements are made with.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    calibration = reconstructor.calibration
    name = f"{calibration.identity} {calibration.verdict} {reconstructor.model} {__version__}"
    return Ledger(path, name)
