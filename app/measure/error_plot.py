"""A sensor's error over time, to make changes visible."""

from __future__ import annotations

from app.measure.judging import DEPTH_FIGURES
from app.services.preferences import Limits
from app.widgets.time_chart import DEPTH, PLANE, Series
from gelpolight_core.records.entry import MeasurementRecord


def errors_over_time(records: tuple[MeasurementRecord, ...], limits: Limits) -> tuple[Series, ...]:
    """Return the errors of the measurements that have a true value: in the plane, and in depth.

    Parameters
    ----------
    records : tuple of MeasurementRecord
        Of one sensor, in any order.
    limits : Limits
        Position of the limit lines.
    """
    found: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for record in sorted(records, key=lambda r: r.time):
        for quantity in record.quantities:
            if quantity.error_percent is not None:
                in_depth = quantity.name.rpartition("_")[0] in DEPTH_FIGURES
                found[in_depth].append((record.time.timestamp(), quantity.error_percent))
    plane, depth = (tuple(zip(*points, strict=True)) or ((), ()) for points in found.values())
    return (
        Series("in the plane", plane[0], plane[1], limits.size_percent, PLANE, "o"),
        Series("in depth", depth[0], depth[1], limits.height_percent, DEPTH, "t"),
    )
