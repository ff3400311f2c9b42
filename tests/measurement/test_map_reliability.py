"""A measurement is never better than its calibration, whatever it is measured with."""

from dataclasses import replace

import pytest

from app.measure.measurement_engine import apply_tool
from gelpolight_core import measure, read_height_map, write_height_map
from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.lab.evaluation_run import press_measurement
from gelpolight_core.measurement.tools.indenter_tools import CylinderTool
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation import indenters
from gelpolight_core.simulation.virtual_sensor import PressedMembrane
from gelpolight_core.studies.exact_sensor import known_sensor, matt_design

PRESS = "cylinder_s5_d100.png"


def judged_as(calibration: Calibration, value: float) -> Calibration:
    """Return a calibration whose last figure is a value between warn at 5 % and fail at 20 %."""
    figure = judge("depth_test", "Depth off the ball", value, "%", warn=5.0, fail=20.0)
    passed = {
        name: QualityTable(tuple(f for f in table.figures if f.verdict is not Verdict.FAIL))
        for name, table in calibration.quality.items()
    }
    return replace(calibration, quality={**passed, "test": QualityTable((figure,))})


@pytest.mark.parametrize(("value", "doubtful"), [(1.0, False), (10.0, False), (41.7, True)])
def test_a_failed_calibration_makes_every_measurement_doubtful(
    small_session, small_calibration, value, doubtful
):
    calibration = judged_as(small_calibration, value)
    path = small_session / "presses" / PRESS
    reconstructor = Reconstructor(calibration)
    press = press_measurement(reconstructor)(path, ReferenceObject("cylinder", 5.0, height_mm=1.0))
    heightmap = reconstructor.depth(read_linear_image(path).rgb)
    on_page = apply_tool(CylinderTool(), heightmap).result
    assert on_page is not None
    assert on_page.measurement is not None
    for result in (press, on_page, on_page.measurement):
        assert ("41.7 %" in result.reason) is doubtful
        if doubtful:
            assert result.verdict == "doubtful"
    alone = CylinderTool().apply(heightmap)
    assert on_page.figures == alone.figures
    if not doubtful:
        assert on_page.verdict == alone.verdict


def test_a_measurement_is_never_better_than_its_height_map(tmp_path):
    """Walls too steep for the lights: heights were off by more than 3 sd and called ok."""
    known = known_sensor(matt_design(0.5))
    for decay_mm, doubtful in ((0.18, True), (0.7, False)):
        surface = indenters.press_surface(
            indenters.CylinderIndenter(5.0, 1.0), x_mm=0.4, decay_mm=decay_mm
        )
        frame = known.sensor.frame(PressedMembrane(surface), stream="press")
        for model in ("full", "paper"):
            height_map = Reconstructor(known.calibration, model=model).depth(frame)
            (path,) = write_height_map(height_map, tmp_path / f"{model} {decay_mm}")
            found = measure(height_map, shape="cylinder")
            assert doubtful or abs(found.height_mm - 1.0) < 3.0 * found.sd["height_mm"]
            for result in (found, measure(read_height_map(path), shape="cylinder")):
                # Slopes of the paper's model fit a cylinder less closely, and may be doubtful, too.
                assert doubtful <= (result.verdict == "doubtful") <= (doubtful or model == "paper")
                assert doubtful or abs(result.diameter_mm - 5.0) < 2.0 * result.sd["diameter_mm"]
                known_reasons = [f.text for f in height_map.findings if f.text in result.reason]
                assert bool(known_reasons) is doubtful
