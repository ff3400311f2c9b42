"""An evaluation by the protocol as one entry of the lab's records."""

from __future__ import annotations

import math
from dataclasses import asdict

from gelpolight_core.io.store import Store
from gelpolight_core.measurement.evaluation import DIRECTIONS, Evaluation, evaluation_errors
from gelpolight_core.quantity import Quantity
from gelpolight_core.records.entry import DOUBTFUL, OF_VERDICT, MeasurementRecord

SHAPE = "evaluation"


def evaluation_record(
    evaluation: Evaluation,
    *,
    serial: str,
    calibration_id: str,
    operator: str = "",
    folder: str = "",
) -> MeasurementRecord | None:
    """Return the record of a whole evaluation: its mean absolute errors.

    Parameters
    ----------
    evaluation : Evaluation
        Evaluation of all presses.
    serial, calibration_id, operator
        As in :class:`MeasurementRecord`.
    folder : str
        Folder of the presses; stored as the image name.

    Returns
    -------
    record : MeasurementRecord or None
        None if nothing could be measured.
    """
    errors = {direction: evaluation.overall(direction).mean_absolute for direction in DIRECTIONS}
    found = {direction: error for direction, error in errors.items() if math.isfinite(error)}
    if not found:
        return None
    quantities = tuple(
        Quantity(f"{direction}_error_percent", error) for direction, error in found.items()
    )
    failed = evaluation.failure
    return MeasurementRecord(
        serial=serial,
        calibration_id=calibration_id,
        shape=SHAPE,
        quantities=quantities,
        verdict=DOUBTFUL if failed else OF_VERDICT[evaluation_errors(evaluation).verdict],
        reason=failed,
        settings={"limits_percent": dict(zip(DIRECTIONS, evaluation.limits_percent, strict=True))},
        details={
            "groups": [
                asdict(group) | {"statistic": group.statistic.as_json("percent")}
                for group in evaluation.groups
            ]
        },
        operator=operator,
        picture=folder,
    )


def add_once(records: Store, record: MeasurementRecord) -> int:
    """Add an evaluation, unless the same run with the same errors is already stored.

    Returns
    -------
    number : int
        Number of the new entry; 0 if nothing was added.
    """
    for known in records.all(MeasurementRecord):
        same = (known.shape, known.picture, known.calibration_id) == (
            record.shape,
            record.picture,
            record.calibration_id,
        )
        if same and known.quantities == record.quantities:
            return 0
    return records.add(record)
