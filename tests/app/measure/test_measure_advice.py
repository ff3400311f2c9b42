"""The advice on the Measure page."""

from dataclasses import replace

from test_reference_form import LIVE

from app.live.next_step_advice import PREPARING, CalibrationTarget, LiveState, action_of
from app.measure.press_state import advice_of
from gelpolight_core.base.finding import Finding, Verdict

USED = CalibrationTarget("A-1", (1280, 960))


def advised(
    now: LiveState, *findings: Finding, frozen: bool = False, earlier: bool = False, why: str = ""
) -> Finding:
    state = replace(LIVE, frozen=frozen, earlier=earlier)
    advice = advice_of(now, state, refused=why, findings=findings)
    return advice


def test_without_a_calibration_the_advice_is_to_choose_one():
    assert action_of(advised(LiveState())) == "sensors"
    assert action_of(advised(LiveState(kind="virtual", serial="V"))) == "calibrate"
    assert advised(LiveState(reading=True), frozen=True) is PREPARING


def test_a_press_is_requested_and_a_frozen_one_needs_no_advice():
    ready = LiveState(kind="camera", size=(1280, 960), used=USED)
    assert "Press" in advised(ready).text
    assert advice_of(ready, LIVE, refused="") is None
    cut = (Finding("dim", "it is dim", remedy="Light it"), Finding("cut", "it is cut off"))
    noted = advised(ready, *cut, frozen=True)
    assert (noted.line, noted.verdict) == ("It is dim. Light it. It is cut off.", Verdict.WARN)
    refused = advised(ready, frozen=True, why="it is grey")
    assert (refused.text, action_of(refused)) == ("it is grey", "live")
    other = CalibrationTarget("B-2", (1280, 960))
    from_other = replace(ready, serial="B-2", calibrations=(USED, other))
    assert action_of(advised(from_other, frozen=True, why="of another sensor")) == "fitting"
    earlier = advised(ready, frozen=True, earlier=True)
    assert (action_of(earlier), earlier.verdict) == ("live", Verdict.WARN)
