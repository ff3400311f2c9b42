"""Errors and verdicts: equal to the core's comparison, and none without a true value."""

from dataclasses import replace

import numpy as np
import pytest

from app.measure.record_table import record_cells
from app.measure.records_view import errors_over_time
from app.measure.reference_comparison import quantities_of, record_of
from app.program.preferences import WarningLimits
from app.widgets.icons import icon
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import Verdict, doubtful_finding
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.tools.indenter_tools import CylinderTool
from gelpolight_core.measurement.tools.point_tools import DistanceTool
from gelpolight_core.measurement.tools.tool_base import ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.reference_object import ReferenceObject

DEFAULT_LIMITS = WarningLimits()
FIT = Measurement(
    shape="cylinder",
    diameter_mm=5.1,
    side_mm=None,
    height_mm=1.02,
    centre_mm=(0.0, 0.0),
    yaw_deg=None,
    drape_decay_mm=0.7,
    sd={"diameter_mm": 0.02, "height_mm": 0.003, "centre_mm": (0.01, 0.01), "drape_decay_mm": 0.1},
    edge_radius_mm=0.08,
    blur_mm=0.05,
    baseline_mm=0.0,
    residual_rms_mm=0.001,
    outline_mm=np.zeros((3, 2)),
)
PRESSED = ToolResult(
    CylinderTool((0.0, 0.0)), (MeasuredValue(5.1, 0.02, "mm", "diameter"),), (), measurement=FIT
)
APART = ToolResult(
    DistanceTool((0.0, 0.0), (3.0, 0.0)), (MeasuredValue(3.0, 0.01, "mm", "distance"),), ()
)


def _record(
    result: ToolResult, reference: ReferenceObject, limits: WarningLimits = DEFAULT_LIMITS
) -> MeasurementRecord:
    flat = np.zeros((2, 2), np.float32)
    axis, flags = np.arange(2.0), flat.astype(np.uint8)
    heightmap = HeightMap(flat, axis, axis, 1.0, None, flags, "A-1", "full", "p.png")
    return record_of(
        result, reference, heightmap, limits=limits, serial="A", operator="Ada", note="by hand"
    )


def test_only_what_is_known_is_judged():
    def limits(result: ToolResult, reference: ReferenceObject) -> dict[str, float | None]:
        found = quantities_of(result, reference, WarningLimits())
        return {q.name: q.limit_percent for q in found if q.verdict is not None}

    assert limits(PRESSED, ReferenceObject()) == {}
    assert limits(PRESSED, ReferenceObject(size_mm=5.0)) == {"diameter_mm": 5.0}
    assert limits(PRESSED, ReferenceObject(height_mm=1.0)) == {"height_mm": 8.0}
    (apart,) = quantities_of(APART, ReferenceObject(size_mm=2.0), WarningLimits())
    assert apart.error_percent == pytest.approx(50.0)
    assert apart.verdict is Verdict.FAIL


@pytest.mark.function("Compare with the true size, with limits of one's own")
def test_the_verdict_follows_the_limits():
    reference = ReferenceObject(size_mm=5.0, height_mm=1.0)
    assert _record(PRESSED, reference).verdict == "pass"
    strict = WarningLimits(size_percent=1.0)
    assert _record(PRESSED, reference, strict).verdict == "fail"
    doubtful = replace(PRESSED, findings=(doubtful_finding("cut", "cut"),))
    assert _record(doubtful, reference).verdict == "doubtful"
    assert _record(PRESSED, ReferenceObject()).verdict == ""


def test_what_is_measured_along_the_depth_is_judged_by_the_limit_of_heights():
    quantities = tuple(
        Quantity(f"{name}_mm", 1.02, truth=1.0) for name in ("depth_difference", "distance")
    )
    record = MeasurementRecord("A-1", "", "distance", quantities)
    plane, depth = errors_over_time((record,), WarningLimits())
    assert plane.values == depth.values == pytest.approx((2.0,))
    assert (plane.limit, depth.limit) == (5.0, 8.0)
    assert plane.times_s == (record.time.timestamp(),)


def test_an_evaluation_has_a_row_with_its_mean_errors(qapp):
    quantities = Quantity("planar_error_percent", 2.0), Quantity("depth_error_percent", 4.0)
    cells = record_cells(MeasurementRecord("A", "A-1", "evaluation", quantities, "pass"))
    texts = [cell.text for cell in cells]
    assert "Evaluation (mean errors)" in texts
    assert {"2.00 %", "4.00 %"} <= set(texts)
    for cell in cells:
        if cell.icon:
            icon(cell.icon, cell.role)


def test_a_record_of_a_tool_that_is_not_installed_any_more_has_a_name_and_an_icon(qapp):
    cell = record_cells(MeasurementRecord("A", "A-1", "depth_at", (Quantity("depth_mm", 1.0),)))[2]
    assert cell.text == "Depth at"
    icon(cell.icon, cell.role)
