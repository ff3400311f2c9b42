"""A measured object with what it was measured on, for its certificate."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reference import Truth


@dataclass(frozen=True, slots=True)
class MeasuredPress:
    """A measured object with what it was measured on.

    Attributes
    ----------
    name : str
        Of the image.
    sha256 : str
        Of the image's file; empty for an image of the camera.
    height_map : HeightMap
        Reconstructed from it.
    measurement : Measurement
        Judged with the height map.
    truth : Truth or None
        The reference, if one is known.
    """

    name: str
    sha256: str
    height_map: HeightMap
    measurement: Measurement
    truth: Truth | None = None
