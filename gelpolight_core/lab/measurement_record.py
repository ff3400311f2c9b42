"""One entry of the lab's records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.store import Entry

STORED = {Verdict.PASS: "pass", Verdict.WARN: "undecided", Verdict.FAIL: "fail"}
"""What is stored for the verdict of a comparison."""
DOUBTFUL = "doubtful"
FILE = "file"
"""Setting with the path of the image, empty if it was not a file."""


@dataclass(frozen=True, slots=True)
class MeasurementRecord(Entry):
    """A stored measurement with the time when it was measured.

    Attributes
    ----------
    serial, calibration_id : str
        Sensor and calibration.
    shape : str
        Tool or shape: ``cylinder``, ``cuboid``, ``ball``, ``distance``, ``step_height``, ...
    quantities : tuple of Quantity
        The measured values; at least one.
    verdict : str
        ``pass``, ``fail``, ``undecided`` where the uncertainty is too large to decide,
        ``doubtful``, or empty if there was nothing to judge.
    reason : str
        Reason for ``doubtful``.
    settings : mapping
        Model, camera and tool settings; plain values.
    details : mapping
        All other data of the measurement, as written by ``measure --json``.
    operator : str
        Name of the user.
    picture : str
        The image or recording, with the frame if it is one of several.
    note : str
        Note by the user.
    """

    kind: ClassVar[str] = "measurement"
    serial: str
    calibration_id: str
    shape: str
    quantities: tuple[Quantity, ...]
    verdict: str = ""
    reason: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    operator: str = ""
    picture: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        """Refuse a measurement without quantities or sensor, or with a time without zone."""
        names = [quantity.name for quantity in self.quantities]
        if not names or len(set(names)) != len(names):
            raise ValueError(
                f"the quantities of a measurement must have different names, not {names}"
            )
        if not self.serial:
            raise ValueError("a measurement needs a sensor")
        if self.time.tzinfo is None:
            raise ValueError("the time has no zone")

    def quantity(self, name: str) -> Quantity | None:
        """Return the quantity with a name, or None if it was not measured."""
        return next((q for q in self.quantities if q.name == name), None)


def verdict_of(quantities: Sequence[Quantity], *, doubtful: bool) -> str:
    """Return the verdict on a measurement: the worst one of its quantities."""
    if doubtful:
        return DOUBTFUL
    judged = QualityTable(tuple(q.finding for q in quantities if q.finding is not None))
    return STORED[judged.verdict] if judged.figures else ""
