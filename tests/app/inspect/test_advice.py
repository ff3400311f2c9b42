"""What the Inspect page says is to be done next."""

from __future__ import annotations

import pytest

from app.inspect.advice import Advice, Known, Situation, advise

MINE = Known("A", (1280, 960))


@pytest.mark.parametrize(
    ("now", "act", "usable"),
    [
        (Situation(), "virtual", False),
        (Situation("virtual", "virtual-1"), "calibrate", False),
        (Situation("folder"), "sensors", False),
        (Situation("folder", calibrations=(MINE,)), "fitting", False),
        (Situation("recording", "B", used=MINE), "sensors", False),
        (
            Situation("recording", "B", used=MINE, calibrations=(Known("B", (9, 9)),)),
            "fitting",
            False,
        ),
        (Situation("folder", size=(640, 480), used=MINE), "sensors", False),
        (Situation("folder", size=MINE.size, used=MINE, trouble="it broke"), "reopen", True),
        (Situation("folder", size=MINE.size, used=MINE, drift="it moved"), "zero", True),
    ],
)
def test_what_is_missing_is_said_with_a_way_out(now: Situation, act: str, usable: bool) -> None:
    advice = advise(now)
    assert advice.text and advice.button
    assert (advice.act, advice.usable) == (act, usable)


def test_nothing_is_said_while_all_is_well() -> None:
    assert advise(Situation("recording", "A", MINE.size, MINE)) == Advice()


def test_a_calibration_of_another_sensor_or_size_is_named() -> None:
    other = advise(Situation("recording", "B", used=MINE)).text
    assert "A" in other and "B" in other
    size = advise(Situation("folder", size=(640, 480), used=MINE)).text
    assert "640x480" in size and "1280x960" in size


def test_a_calibration_that_is_being_read_is_not_called_missing() -> None:
    for now in (Situation("camera", reading=True), Situation("virtual", "V", reading=True)):
        advice = advise(now)
        assert "ready" in advice.text and not advice.usable and not advice.act
