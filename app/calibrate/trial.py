"""One trial of a calibration: press an object of known size, measure it, compare."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.quantity import Quantity
from gelpolight_core.measurement.result import Measurement, Truth, compare
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import average_frames
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Trial:
    """The result of a trial.

    Attributes
    ----------
    measurement : Measurement
        Measurement of the object.
    comparisons : tuple of Quantity
        The lengths with their true values and limits.
    heightmap : HeightMap
        The depth it was measured in.
    """

    measurement: Measurement
    comparisons: tuple[Quantity, ...]
    heightmap: HeightMap


def run_trial(
    frames: Sequence[NDArray[Any]],
    reconstructor: Reconstructor,
    known: Truth,
    *,
    limits_percent: tuple[float, float],
    progress: Callable[[float], None],
) -> Trial:
    """Measure the object in frames of one press.

    Parameters
    ----------
    frames : sequence of (rows, columns, 3) uint8 or uint16
        RGB images; they are averaged before the reconstruction.
    reconstructor : Reconstructor
        Reconstructor with the calibration to validate.
    known : Truth
        The pressed object; its height is NaN if it is not known.
    limits_percent : (float, float)
        Largest errors of size and height with which the trial passes.
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
    both = compare(measured, known, limits_percent)
    names = (tr("side") if known.shape == "cuboid" else tr("diameter"), tr("height"))
    comparisons = tuple(
        replace(quantity, name=name)
        for quantity, name in zip(both, names, strict=True)
        if quantity.truth is not None
    )
    measured = judged(measured, heightmap)
    return Trial(measured, comparisons, heightmap)
