"""The advice on the Measure page."""

from __future__ import annotations

from app.live.advice import PREPARING, Known, LiveState, action_of
from app.measure.advice import measuring_advice
from gelpolight_core.finding import Finding, Verdict

USED = Known("A-1", (1280, 960))


def advice_of(
    now: LiveState, *findings: Finding, frozen: bool = False, refused: str = ""
) -> Finding:
    advice = measuring_advice(now, frozen=frozen, refused=refused, findings=findings)
    assert advice is not None
    return advice


def test_without_a_calibration_the_advice_is_to_choose_one() -> None:
    assert action_of(advice_of(LiveState())) == "sensors"
    assert action_of(advice_of(LiveState(kind="virtual", serial="V"))) == "calibrate"
    assert advice_of(LiveState(reading=True), frozen=True) is PREPARING


def test_images_of_another_sensor_or_size_are_refused_with_both_values() -> None:
    other = LiveState(kind="recording", serial="B-2", size=(1280, 960), used=USED)
    assert not other.usable
    assert "A-1" in advice_of(other).text and "B-2" in advice_of(other).text
    small = LiveState(kind="camera", size=(640, 480), used=USED)
    assert "640x480" in advice_of(small).text


def test_a_press_is_requested_and_a_frozen_one_needs_no_advice() -> None:
    ready = LiveState(kind="camera", size=(1280, 960), used=USED)
    assert "Press" in advice_of(ready).text
    assert measuring_advice(ready, frozen=True, refused="") is None
    cut = (Finding("dim", "it is dim", remedy="Light it"), Finding("cut", "it is cut off"))
    noted = advice_of(ready, *cut, frozen=True)
    assert (noted.line, noted.verdict) == ("It is dim. Light it. It is cut off.", Verdict.WARN)
    refused = advice_of(ready, frozen=True, refused="it is grey")
    assert (refused.text, action_of(refused)) == ("it is grey", "live")
