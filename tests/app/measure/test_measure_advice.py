"""The advice on the Measure page."""

from __future__ import annotations

from app.live.advice import Known, LiveState
from app.measure.advice import measuring_advice
from gelpolight_core.finding import Finding

USED = Known("A-1", (1280, 960))


def test_without_a_calibration_the_advice_is_to_choose_one() -> None:
    assert measuring_advice(LiveState(), frozen=False, refused="").act == "sensors"
    demo = measuring_advice(LiveState(kind="virtual", serial="V"), frozen=False, refused="")
    assert demo.act == "calibrate"


def test_images_of_another_sensor_or_size_are_refused_with_both_values() -> None:
    other = LiveState(kind="recording", serial="B-2", size=(1280, 960), used=USED)
    found = measuring_advice(other, frozen=False, refused="")
    assert not found.usable
    assert "A-1" in found.text
    assert "B-2" in found.text
    small = LiveState(kind="camera", size=(640, 480), used=USED)
    assert "640x480" in measuring_advice(small, frozen=False, refused="").text


def test_a_press_is_requested_and_a_frozen_one_needs_no_advice() -> None:
    ready = LiveState(kind="camera", size=(1280, 960), used=USED)
    assert "Press" in measuring_advice(ready, frozen=False, refused="").text
    assert measuring_advice(ready, frozen=True, refused="").text == ""
    cut = (Finding("dim", "it is dim", remedy="Light it"), Finding("cut", "it is cut off"))
    noted = measuring_advice(ready, frozen=True, refused="", findings=cut)
    assert (noted.text, noted.role) == ("It is dim. Light it. It is cut off.", "warn")
    refused = measuring_advice(ready, frozen=True, refused="it is grey")
    assert (refused.text, refused.act) == ("it is grey", "live")
