"""The depth map of one picture, with all that is needed to use it elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.plan import Plan


class Flag(IntFlag):
    """Why the depth of a pixel is to be trusted less; several may hold at once."""

    OUTSIDE = 1
    """Outside the working area or the picture."""
    SATURATED = 2
    """A channel at its upper end: it says nothing."""
    DARK = 4
    """A channel without signal: in shadow."""
    EXTRAPOLATED = 8
    """Reflectance table used beyond its data."""
    NOT_OBSERVABLE = 16
    """Wall turned away from the camera."""
    INVALID = 32
    """Not finite, or no light or reflectance factor there."""


FLAG_NAMES = MappingProxyType({str(flag.name).lower(): flag.value for flag in Flag})
"""Name of each flag in files, and its value in `HeightMap.flags`."""

SD_MAPS = ("slope_sd", "depth_sd_mm", "slope_model_sd", "depth_model_sd_mm")
"""The maps of standard deviations that a height map may hold."""


@dataclass(frozen=True, slots=True)
class HeightMap:
    """Depth of the membrane on a regular metric grid in the sensor frame.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Indentation towards the camera; the surface is at z = -depth.
    x_mm : (columns,)
        Places of the columns, at `pitch_mm` from each other, rising.
    y_mm : (rows,)
        Places of the rows, at `pitch_mm` from each other, rising.
    pitch_mm : float
        Distance between neighbouring grid points.
    normals : (rows, columns, 3) float32 or None
        Unit normals of the membrane in the sensor frame, towards the camera (z < 0).
    flags : (rows, columns) uint8
        Sums of :class:`Flag`.
    calibration_id : str
        Of the calibration that the depth was made with.
    model : str
        ``paper`` or ``full``.
    source : str
        Name of the picture, such as ``press_03.png``.
    notes : tuple of str
        What is to be said of this map, in sentences for a person.
    slope_sd, depth_sd_mm : (rows, columns) float32 or None
        What repeats of the picture scatter by: standard deviations of the surface's slopes (root
        mean square of x and y) and of the depth, from the picture's noise. None where they were
        not asked for, or by the paper's model.
    slope_model_sd, depth_model_sd_mm : (rows, columns) float32 or None
        The same from what the model does not explain of a press: alike in every repeat, another
        in every press.
    noise_mm : (examples, rows / 4, columns / 4) float32 or None
        Errors of the depth that this noise could as well have made, on every fourth of the nodes
        (averages over blocks of 4 x 4).
    depth_scale_sd, lateral_scale_sd : float or None
        Relative standard deviations, from the calibration, of depths and slopes, and of lengths
        across. They are common to all pixels and all pictures of a calibration: the standard
        deviation of a depth is the root of the sum of squares of `depth_sd_mm`,
        `depth_model_sd_mm`, and `depth_scale_sd` times the depth. None where the calibration does
        not say.
    plan : Plan or None
        Which steps were done, and why the others were left out.

    Raises
    ------
    ValueError
        Where the shapes do not fit each other.
    """

    depth_mm: NDArray[np.float32]
    x_mm: NDArray[np.floating]
    y_mm: NDArray[np.floating]
    pitch_mm: float
    normals: NDArray[np.float32] | None
    flags: NDArray[np.uint8]
    calibration_id: str
    model: str
    source: str
    notes: tuple[str, ...] = ()
    slope_sd: NDArray[np.float32] | None = None
    depth_sd_mm: NDArray[np.float32] | None = None
    slope_model_sd: NDArray[np.float32] | None = None
    depth_model_sd_mm: NDArray[np.float32] | None = None
    noise_mm: NDArray[np.float32] | None = None
    depth_scale_sd: float | None = None
    lateral_scale_sd: float | None = None
    plan: Plan | None = None

    def __post_init__(self) -> None:
        """Check that the shapes fit each other."""
        rows, columns = self.depth_mm.shape
        expected = {"x_mm": (columns,), "y_mm": (rows,), "flags": (rows, columns)}
        if self.normals is not None:
            expected["normals"] = (rows, columns, 3)
        for name in SD_MAPS:
            if getattr(self, name) is not None:
                expected[name] = (rows, columns)
        for name, shape in expected.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise ValueError(f"{name} of shape {found} beside a depth map of {rows, columns}")
