"""The steps of the last minute."""

from gelpolight_core.reconstruction.trace import Trace, TraceStep
from gelpolight_core.reconstruction.trace_tally import TraceTally

PRESSED = Trace("fast", (TraceStep("looking", True, "", 1.0), TraceStep("solving", True, "", 8.0)))
EMPTY = Trace("fast", (TraceStep("looking", True, "", 1.0), TraceStep("solving", False, "why")))


def test_steps_are_counted_and_what_was_left_out_has_saved_its_time():
    tally = TraceTally()
    for second in range(30):
        tally.add(PRESSED if second % 3 == 0 else EMPTY, float(second))
    looking, solving = tally.counts(30.0)
    assert (looking.done, looking.left_out, looking.saved_ms) == (30, 0, 0.0)
    assert (solving.done, solving.left_out) == (10, 20)
    assert solving.mean_ms == 8.0 and solving.saved_ms == 160.0
    assert "30 frames" in tally.lines(30.0)[0] and "20 times" in tally.lines(30.0)[2]
