"""A measurement is never better than its calibration, whatever it is measured with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.command_line.main import main
from app.measure.measuring import apply_tool
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.measurement.indenter_tools import Cylinder
from gelpolight_core.measurement.presses import press_measurement
from gelpolight_core.measurement.tools import ToolResult
from gelpolight_core.quality import QualityTable, Verdict, judge
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image

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
    small_session: Path, small_calibration: Calibration, value: float, doubtful: bool
) -> None:
    calibration = judged_as(small_calibration, value)
    path = small_session / "presses" / PRESS
    reconstructor = Reconstructor(calibration)
    press = press_measurement(reconstructor)(path, "cylinder")
    heightmap = reconstructor.depth(read_image(path).rgb)
    on_page = apply_tool(Cylinder(), heightmap)
    assert isinstance(on_page, ToolResult)
    assert on_page.measurement is not None
    for result in (press, on_page, on_page.measurement):
        assert ("41.7 %" in result.reason) is doubtful
        if doubtful:
            assert result.verdict == "doubtful"
    alone = Cylinder().apply(heightmap)
    assert on_page.figures == alone.figures
    if not doubtful:
        assert on_page.verdict == alone.verdict


def test_the_command_names_the_figure_that_failed(
    small_session: Path,
    small_calibration: Calibration,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file, press = tmp_path / "c.gplcal", str(small_session / "presses" / PRESS)
    write_calibration(judged_as(small_calibration, 41.7), file)
    for arguments in (("--shape", "cylinder"), ("--tool", "cylinder")):
        assert main(["measure", str(file), press, *arguments]) == 0
        (verdict,) = [x for x in capsys.readouterr().out.splitlines() if "verdict" in x]
        assert "doubtful" in verdict
        assert "Depth off the ball: 41.7 %" in verdict
