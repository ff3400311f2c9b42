"""The advice on the Inspect page."""

import pytest

from app.live.next_step_advice import BUTTONS, CalibrationTarget, LiveState, action_of, advise
from gelpolight_core.base.finding import Finding, Verdict

MINE = CalibrationTarget("A", (1280, 960))
DIM = Finding("exposure", "the light is darker", remedy="Restore it", verdict=Verdict.WARN)
OFF = Finding("led_off", "the red LED is off", remedy="Check it", verdict=Verdict.FAIL)


@pytest.mark.function("See the next action when something is missing, with a button for it")
@pytest.mark.parametrize(
    ("now", "act", "usable"),
    [
        (LiveState(), "virtual", False),
        (LiveState("virtual", "virtual-1"), "calibrate", False),
        (LiveState("folder"), "sensors", False),
        (LiveState("folder", calibrations=(MINE,)), "fitting", False),
        (LiveState("recording", "B", used=MINE), "sensors", False),
        (
            LiveState("recording", "B", used=MINE, calibrations=(CalibrationTarget("B", (9, 9)),)),
            "fitting",
            False,
        ),
        (LiveState("folder", size=(640, 480), used=MINE), "sensors", False),
        (
            LiveState("camera", size=(640, 480), offered=((640, 480), MINE.size), used=MINE),
            "image_size",
            False,
        ),
        (
            LiveState(
                "camera",
                size=(6, 4),
                offered=(MINE.size,),
                used=MINE,
                other_camera="It is another.",
            ),
            "sensors",
            False,
        ),
        (LiveState("camera", size=(640, 480), offered=((640, 480),), used=MINE), "sensors", False),
        (LiveState("folder", size=MINE.size, used=MINE, trouble="it broke"), "reopen", True),
        (LiveState("folder", size=MINE.size, used=MINE, fault=DIM), "zero", True),
    ],
)
def test_advice_names_what_is_missing_and_offers_an_action(now, act, usable):
    advice = advise(now)
    assert advice is not None and advice.text
    assert (action_of(advice), now.usable) == (act, usable)
    assert act in BUTTONS


@pytest.mark.function("Be told of a fault of the image: light, dirt, another sensor")
def test_a_fault_of_the_image_is_shown_in_one_line_and_zero_is_offered_where_it_helps():
    dim = advise(LiveState("camera", size=MINE.size, used=MINE, fault=DIM))
    off = advise(LiveState("camera", size=MINE.size, used=MINE, fault=OFF))
    assert (dim, action_of(dim)) == (DIM, "zero")
    assert (off, action_of(off)) == (OFF, "")


def test_a_calibration_being_read_is_not_reported_missing():
    for now in (LiveState("camera", reading=True), LiveState("virtual", "V", reading=True)):
        advice = advise(now)
        assert advice is not None and not now.usable and not action_of(advice)
        assert "calibration" in advice.text
