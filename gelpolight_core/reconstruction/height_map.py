"""The depth map of one image, with all data needed to use it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.finding import Finding
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.health.frame_health import FrameHealth

from .trace import Trace

COARSE = 4
"""Nodes of the grid to a node of the coarsest scale, and of examples of noise, along an axis."""


class Flag(IntFlag):
    """Reasons, one or several, why the depth of a pixel is less reliable.

    - ``OUTSIDE`` (1): outside the working area or the image; the depth is 0
    - ``SATURATED`` (2): a saturated channel
    - ``DARK`` (4): a channel in shadow, as at the walls of every press
    - ``EXTRAPOLATED`` (8): reflectance table used beyond its data
    - ``NOT_OBSERVABLE`` (16): wall turned away from the camera
    - ``INVALID`` (32): not finite, or no light or reflectance factor there
    - ``UNANCHORED`` (64): the depth may be wrong by a constant

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> gp.Flag.DARK in gp.Flag(6)
    True
    >>> gp.Flag(6)
    <Flag.SATURATED|DARK: 6>
    """

    OUTSIDE = 1
    """Outside the working area or the image."""
    SATURATED = 2
    """A saturated channel: it contains no information."""
    DARK = 4
    """A channel without signal: in shadow."""
    EXTRAPOLATED = 8
    """Reflectance table used beyond its data."""
    NOT_OBSERVABLE = 16
    """Wall turned away from the camera."""
    INVALID = 32
    """Not finite, or no light or reflectance factor there."""
    UNANCHORED = 64
    """Nearly all of the boundary is pressed: the depth may be wrong by a constant."""


FLAG_NAMES = MappingProxyType({str(flag.name).lower(): flag.value for flag in Flag})
"""Name of each flag in files, and its value in `HeightMap.flags`."""

SD_MAPS = ("slope_sd", "depth_sd_mm", "slope_model_sd", "depth_model_sd_mm")
"""The maps of standard deviations that a height map can contain."""

SENSOR_NUMBERS = ("depth_scale_sd", "lateral_scale_sd", "visible_depth_mm", "image_blur_mm")
"""The numbers of the sensor that a height map can contain."""


@dataclass(frozen=True, slots=True)
class HeightMap:
    """Depth of the membrane on a regular metric grid in the sensor frame.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Indentation along z towards the camera, from the undeformed membrane.
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
        Sensor of the calibration.
    model : str
        ``paper`` or ``full``.
    source : str
        Name of the image, such as ``press_03.png``.
    findings : tuple of Finding
        About this map: why heights may be wrong, the faults of its image, and what else to know. A
        measurement of it is not better than they are.
    slope_sd, depth_sd_mm : (rows, columns) float32 or None
        Scatter of repeated images: standard deviations of the slopes of the surface (root mean
        square of x and y) and of the depth, from the noise of the image. None where they were
        not requested, or by the paper's model.
    slope_model_sd, depth_model_sd_mm : (rows, columns) float32 or None
        The same from errors of the model: equal in every repeat, different in every press.
    noise_mm : (examples, rows / 4, columns / 4) float32 or None
        Examples of depth errors that this noise can cause, on every fourth node (averages over
        blocks of 4 x 4).
    depth_scale_sd, lateral_scale_sd : float or None
        Relative standard deviations, from the calibration and the lengths stated for it, of
        depths and slopes, and of lengths across. They are common to all pixels and all images of
        a calibration: the standard deviation of a depth is the root of the sum of squares of
        `depth_sd_mm`, `depth_model_sd_mm`, and `depth_scale_sd` times the depth. None if the
        calibration does not state it.
    visible_depth_mm : float or None
        Smallest depth of a pressed flat face that is visible above the noise; a shallower face has
        depth 0. None where contacts were not looked for: the paper's model looks for one only in
        images that show none at first sight.
    image_blur_mm : float or None
        Standard deviation of the blur of the sensor's images, on the membrane; of a closed sensor,
        of their smoothing. None where no board showed it.
    trace : Trace or None
        Which steps were done, and why the others were left out.
    health : FrameHealth or None
        The check of its frame.
    lateral_per_mm : float
        Relative error of the width of an object per mm of its depth: the paper's model uses the
        point where the ray meets the undeformed surface. 0 for the full model.
    at_rest : MembraneShape
        The undeformed membrane.

    Raises
    ------
    ValueError
        If the shapes do not match.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> height_map = sensor.depth(gp.read_image("session/presses/cylinder_s5_d100.png"))
    >>> height_map.depth_mm.shape == (len(height_map.y_mm), len(height_map.x_mm))
    True
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
    findings: tuple[Finding, ...] = ()
    slope_sd: NDArray[np.float32] | None = None
    depth_sd_mm: NDArray[np.float32] | None = None
    slope_model_sd: NDArray[np.float32] | None = None
    depth_model_sd_mm: NDArray[np.float32] | None = None
    noise_mm: NDArray[np.float32] | None = None
    depth_scale_sd: float | None = None
    lateral_scale_sd: float | None = None
    visible_depth_mm: float | None = None
    image_blur_mm: float | None = None
    trace: Trace | None = None
    health: FrameHealth | None = None
    lateral_per_mm: float = 0.0
    at_rest: MembraneShape = FLAT

    @property
    def height_mm(self) -> NDArray[np.float32]:
        """Height (rows, columns) of the pressed membrane itself over the plane of its boundary."""
        if self.at_rest.flat:
            return -self.depth_mm
        points = np.stack(np.meshgrid(self.x_mm, self.y_mm), axis=-1)
        return np.asarray(self.at_rest.height(points) - self.depth_mm, np.float32)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Nodes (rows, columns) in the working area with known depth."""
        return np.asarray(np.isfinite(self.depth_mm) & self.stated)

    @property
    def stated(self) -> NDArray[np.bool_]:
        """Nodes (rows, columns) for which `flags` state a depth."""
        return np.asarray((self.flags & np.uint8(Flag.OUTSIDE | Flag.INVALID)) == 0)

    @property
    def doubtful_findings(self) -> tuple[Finding, ...]:
        """The findings by which heights may be wrong."""
        return tuple(finding for finding in self.findings if finding.doubtful)

    def __post_init__(self) -> None:
        """Check that the shapes match."""
        rows, columns = self.depth_mm.shape
        expected = {"x_mm": (columns,), "y_mm": (rows,), "flags": (rows, columns)}
        if self.normals is not None:
            expected["normals"] = (rows, columns, 3)
        for name in SD_MAPS:
            if getattr(self, name) is not None:
                expected[name] = (rows, columns)
        for name, shape in expected.items():
            actual = np.shape(getattr(self, name))
            if actual != shape:
                raise ValueError(f"{name} of shape {actual} beside a depth map of {rows, columns}")


def surface_slopes(
    depth_mm: NDArray[np.float32], pitch_mm: float, *, step: int = 1
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the slopes (rows, columns) of a depth map along x and y, averaged over `step` nodes.

    They are those of a surface, unlike the slopes that were solved for single nodes. The
    integration has removed the inconsistent part of those, 0.4 to 1.5 degrees on real closed
    sensors.
    """
    averaged = cv2.blur(depth_mm, (step, step)) if step > 1 else depth_mm
    slope_y, slope_x = np.gradient(averaged, np.float32(pitch_mm))
    return np.asarray(slope_x, np.float32), np.asarray(slope_y, np.float32)


def normals_from_slopes(
    slope_x: NDArray[np.float32], slope_y: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return unit normals (rows, columns, 3) towards the camera (z < 0), sensor frame.

    Parameters
    ----------
    slope_x, slope_y : (rows, columns) float32
        d(depth)/dx and d(depth)/dy.
    """
    normals = np.empty((*slope_x.shape, 3), np.float32)
    scale = -1.0 / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    normals[..., 0] = slope_x * scale
    normals[..., 1] = slope_y * scale
    normals[..., 2] = scale
    return normals
