"""What the page says to do next."""

from __future__ import annotations

from app.inspect.advice import Known, Situation
from app.measure.advice import measuring_advice

USED = Known("A-1", (1280, 960))


def test_without_a_calibration_one_is_asked_for_first() -> None:
    assert measuring_advice(Situation(), held=False, refused="").act == "sensors"
    demo = measuring_advice(Situation(kind="virtual", serial="V"), held=False, refused="")
    assert demo.act == "calibrate"


def test_pictures_of_another_sensor_or_size_are_not_measured_and_it_is_said_which() -> None:
    other = Situation(kind="recording", serial="B-2", size=(1280, 960), used=USED)
    found = measuring_advice(other, held=False, refused="")
    assert not found.usable
    assert "A-1" in found.text
    assert "B-2" in found.text
    small = Situation(kind="camera", size=(640, 480), used=USED)
    assert "640x480" in measuring_advice(small, held=False, refused="").text


def test_with_everything_there_a_press_is_asked_for_and_a_held_one_is_left_in_peace() -> None:
    ready = Situation(kind="camera", size=(1280, 960), used=USED)
    assert "Press" in measuring_advice(ready, held=False, refused="").text
    assert measuring_advice(ready, held=True, refused="").text == ""
    refused = measuring_advice(ready, held=True, refused="it is grey")
    assert (refused.text, refused.act) == ("it is grey", "live")


def test_a_calibration_that_is_being_read_is_not_called_missing() -> None:
    for held in (False, True):
        found = measuring_advice(Situation(reading=True), held=held, refused="")
        assert "ready" in found.text and not found.act
