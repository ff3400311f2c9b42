"""Errors and verdicts: equal to the core's comparison, and none without a true value."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.measure.inspector import _table
from app.measure.measurement_engine import MeasuredImage, ToolOutcome
from app.measure.press_state import PressState, ResultRow, resolve_press
from app.measure.record_table import TITLES, record_cells
from app.measure.records_view import errors_over_time
from app.measure.reference_comparison import quantities_of, record_of
from app.program.preferences import WarningLimits
from app.widgets.icons import icon
from app.widgets.label import MarkupLabel
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import Verdict, doubtful_finding
from gelpolight_core.geometry.membrane_shape import MembraneShape
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


def _state(
    result: ToolResult, reference: ReferenceObject, heightmap: HeightMap | None = None
) -> PressState:
    work = SimpleNamespace(
        tool=result.tool, chosen=1, answer_of=lambda _key: ToolOutcome(result),
        image=MeasuredImage("p.png"), heightmap=heightmap, busy=False, detecting=False, refused="",
    )  # fmt: skip
    return resolve_press(work, reference, WarningLimits(), freezable=False, earlier=False)


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
    ended = replace(reference, due="2020-01-31", serial="7")
    assert _record(PRESSED, ended).verdict == "doubtful" and "7" in _record(PRESSED, ended).reason
    strict = WarningLimits(size_percent=1.0)
    assert _record(PRESSED, reference, strict).verdict == "fail"
    doubtful = replace(PRESSED, findings=(doubtful_finding("cut", "cut"),))
    assert _record(doubtful, reference).verdict == "doubtful"
    assert _record(PRESSED, ReferenceObject()).verdict == ""


@pytest.mark.parametrize(
    ("sd", "due", "role"), [(0.06, "", "pass"), (0.02, "", "warn"), (0.06, "2020-01-31", "warn")]
)
def test_what_the_uncertainties_do_not_explain_is_not_green(qapp, sd, due, role):
    reference = ReferenceObject(size_mm=5.0, due=due)
    fit = replace(FIT, sd={**FIT.sd, "diameter_mm": sd})
    result = replace(PRESSED, measurement=fit)
    state = _state(result, reference)
    assert (state.rows[0].role, state.verdict_role) == (role, role)
    cells = record_cells(_record(result, reference))
    assert [cells[TITLES.index(title)].role for title in ("Error", "Verdict")] == [role, role]


def test_a_curved_membrane_is_named_as_the_zero_of_the_depth():
    axis, flat = np.arange(2.0), np.zeros((2, 2), np.float32)
    plane = HeightMap(flat, axis, axis, 1.0, None, flat.astype(np.uint8), "A-1", "full", "p.png")
    curved = replace(plane, at_rest=MembraneShape(rise_mm=0.2))
    texts = [_state(APART, ReferenceObject(), zero).image for zero in (None, plane, curved)]
    assert texts[:2] == ["p.png", "p.png"] and "curved" in texts[2]


def test_a_deviation_of_zero_has_no_minus_sign():
    result = replace(PRESSED, measurement=replace(FIT, diameter_mm=4.99999))
    state = _state(result, ReferenceObject(size_mm=5.0))
    assert (state.rows[0].deviation.strip(), state.rows[0].percent) == ("+0.000", "+0.00 %")


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


def test_a_long_label_breaks_rather_than_the_deviations(qtbot):
    def height(label: str) -> int:
        rows = (ResultRow("Diameter", "5.41", "± 0.23"), ResultRow("Centre x", "41", "± 157"))
        table = MarkupLabel(_table((*rows, ResultRow(label, "0.296", ""))), wrap=True)
        qtbot.addWidget(table)
        return table.heightForWidth(272)

    assert height("Deviation from a circle, RMS") - height("RMS") < height("RMS") / 3
