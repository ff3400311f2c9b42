"""A trial of a calibration: an object of known size, measured and compared with its true values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from numpy.typing import NDArray

from gelpolight_core.finding import Verdict
from gelpolight_core.image.linear import linear_image
from gelpolight_core.io.user import user_name
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.result import Measurement, compare
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reference import SHAPES, Truth
from gelpolight_core.session.images import average_frames
from gelpolight_core.validation import Validation


@dataclass(frozen=True, slots=True)
class Trial:
    """The result of one press.

    Attributes
    ----------
    known : Truth
        The pressed object.
    validation : Validation
        The lengths with their true values and limits.
    measurement : Measurement
        Measurement of the object.
    heightmap : HeightMap
        The depth it was measured in.
    """

    known: Truth
    validation: Validation
    measurement: Measurement
    heightmap: HeightMap

    @property
    def recordable(self) -> bool:
        """Whether it says something: a failed trial does, but nothing doubtful validates."""
        return self.measurement.verdict == "ok" or self.validation.verdict is Verdict.FAIL

    def shown(self) -> tuple[str, str]:
        """Return the result as text, and its role."""
        lines = [quantity.sentence for quantity in self.validation.comparisons]
        rows = [line[:1].upper() + line[1:] for line in lines]
        rows += [finding.line for finding in self.known.findings()]
        if self.measurement.verdict == "ok":
            return "\n".join(rows), self.validation.verdict.value
        rows.append(f"Low confidence: {self.measurement.reason}")
        if not self.recordable:
            rows.append("It cannot be recorded. Correct this, then press again.")
        return "\n".join(rows), "warn"


def run_trial(
    frames: Sequence[NDArray[Any]],
    reconstructor: Reconstructor,
    known: Truth,
    limits_percent: tuple[float, float],
) -> Trial:
    """Measure the object in frames of one press; they are averaged before the reconstruction.

    Raises
    ------
    InputError
        If no object is found.
    """
    response = reconstructor.calibration.response
    press = linear_image(average_frames(frames), "press", response=response)
    heightmap = measurable_depth(reconstructor, press)
    measured = measure_heightmap(
        heightmap,
        shape=known.shape,
        edge_radius_mm=known.edge_mm[0],
        edge_radius_sd_mm=known.edge_mm[1],
    )
    names = ("side" if known.shape == "cuboid" else "diameter", "height")
    comparisons = tuple(
        replace(quantity, name=name)
        for quantity, name in zip(compare(measured, known, limits_percent), names, strict=True)
        if quantity.truth is not None
    )
    validation = Validation(
        reconstructor.calibration.identity,
        datetime.now(UTC).isoformat(timespec="seconds"),
        user_name(),
        f"{SHAPES[known.shape]}, {known.size_mm:g} mm",
        comparisons,
    )
    return Trial(known, validation, judged(measured, heightmap), heightmap)
