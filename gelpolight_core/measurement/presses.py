"""Pictures of presses as the evaluation takes them: read, reconstructed, and named for a ledger."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core import __version__
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_picture, require_colour


def picture_reconstruction(reconstructor: Reconstructor) -> Callable[[Path], HeightMap]:
    """Return the function that reads a picture's file and reconstructs it.

    Parameters
    ----------
    reconstructor : Reconstructor
        With the calibration under test.
    """

    def reconstruct(path: Path) -> HeightMap:
        picture = read_picture(path, response=reconstructor.calibration.response)
        require_colour(picture, where=str(path))
        return reconstructor.depth(picture.rgb, name=path.name, normals=False)

    return reconstruct


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
    name = f"{reconstructor.calibration.identity} {reconstructor.model} {__version__}"
    return Ledger(path, name)
