"""One trial of a calibration: press an object of known size, measure it, compare."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.workspace.validation import Comparison
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.capture import average_frames
from gelpolight_core.translation import tr

LIGHT = np.array([-0.5, -0.6, 0.62])


@dataclass(frozen=True, slots=True)
class KnownObject:
    """An object and its true dimensions; None if a dimension is not known.

    Attributes
    ----------
    shape : str
        ``ball``, ``cylinder`` or ``cuboid``.
    size_mm : float
        Diameter, or side of a square cuboid.
    height_mm : float or None
        Depth of the press.
    """

    shape: str
    size_mm: float
    height_mm: float | None


@dataclass(frozen=True, slots=True)
class Trial:
    """The result of a trial.

    Attributes
    ----------
    measurement : Measurement
        Measurement of the object.
    comparisons : tuple of Comparison
        Comparisons with the true values.
    shaded : (rows, columns, 3) uint8
        The shaded depth map with the outline of the object.
    """

    measurement: Measurement
    comparisons: tuple[Comparison, ...]
    shaded: NDArray[np.uint8]


def run_trial(
    frames: Sequence[NDArray[Any]],
    reconstructor: Reconstructor,
    known: KnownObject,
    *,
    size_limit_percent: float,
    height_limit_percent: float,
    progress: Callable[[float], None],
) -> Trial:
    """Measure the object in frames of one press.

    Parameters
    ----------
    frames : sequence of (rows, columns, 3) uint8 or uint16
        RGB images; they are averaged before the reconstruction.
    reconstructor : Reconstructor
        Reconstructor with the calibration to validate.
    known : KnownObject
        The pressed object.
    size_limit_percent, height_limit_percent : float
        Largest errors with which the trial passes.
    progress : callable
        Called with the share that is done.

    Raises
    ------
    InputError
        If no object is found.
    """
    progress(0.1)
    frame, name = average_frames(frames), tr("press")
    heightmap = measurable_depth(reconstructor, frame, name=name)
    progress(0.7)
    measured = measure_heightmap(heightmap, shape=known.shape)
    quantity = tr("side") if known.shape == "cuboid" else tr("diameter")
    comparisons = [Comparison(quantity, measured.size_mm, known.size_mm, size_limit_percent)]
    if known.height_mm is not None:
        comparisons.append(
            Comparison(tr("height"), measured.height_mm, known.height_mm, height_limit_percent)
        )
    measured = judged(measured, heightmap)
    return Trial(measured, tuple(comparisons), shaded_depth(heightmap, measured.outline_mm))


def shaded_depth(
    heightmap: HeightMap, outline_mm: NDArray[np.float64] | None = None
) -> NDArray[np.uint8]:
    """Return a shaded depth map, coloured by depth, (rows, columns, 3) uint8.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    outline_mm : (N, 2), optional
        Closed line to draw.
    """
    depth = heightmap.depth_mm
    slope_y, slope_x = np.gradient(depth.astype(np.float64), heightmap.pitch_mm)
    normal = np.stack([slope_x, slope_y, np.ones_like(slope_x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    shade = np.clip(normal @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    top = max(float(np.percentile(depth, 99.9)), 0.05)
    level = (255.0 * np.clip(depth / top, 0.0, 1.0)).astype(np.uint8)
    colour = cv2.applyColorMap(level, cv2.COLORMAP_VIRIDIS)[..., ::-1].astype(np.float64)
    rgb = np.ascontiguousarray(np.clip(colour * (0.35 + shade[..., None]), 0, 255).astype(np.uint8))
    if outline_mm is not None and len(outline_mm) > 2:
        at = np.stack(
            [
                (outline_mm[:, 0] - heightmap.x_mm[0]) / heightmap.pitch_mm,
                (outline_mm[:, 1] - heightmap.y_mm[0]) / heightmap.pitch_mm,
            ],
            axis=-1,
        )
        points = np.round(16.0 * at).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(rgb, [points], True, (255, 255, 255), 2, cv2.LINE_AA, 4)
    return rgb
