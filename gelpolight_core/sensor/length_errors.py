"""What a calibration says of the errors of lengths."""

from __future__ import annotations

from typing import NamedTuple


class LengthErrors(NamedTuple):
    """Errors that all measurements with one calibration share.

    Attributes
    ----------
    depth, lateral : float
        Relative standard deviations of depths and of lengths across.
    pitch_mm : float
        Distance of the nodes.
    decay_mm : float or None
        Decay length of the drape; None if it is not known.
    floor_mm : float
        Standard deviation of the depth where nothing touches.
    blur_mm : float
        Smoothing of the images before the slopes are computed.
    """

    depth: float
    lateral: float
    pitch_mm: float
    decay_mm: float | None = None
    floor_mm: float = 0.0
    blur_mm: float = 0.0
