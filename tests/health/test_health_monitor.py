"""Live, a fault is shown when it lasts; a gel that has not recovered is worth a wait."""

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.health.faults import health_of
from gelpolight_core.health.frame_health import FrameHealth, refuse_meaningless
from gelpolight_core.health.health_monitor import HealthMonitor

WARN, FAIL = Verdict.WARN, Verdict.FAIL
DOUBTFUL, WRONG = HeightReliability.DOUBTFUL, HeightReliability.MEANINGLESS
DIM = Finding("exposure", "darker", remedy="Restore it", verdict=WARN, heights=DOUBTFUL)
OFF = Finding("led_off", "the LED is off", remedy="Check it", verdict=FAIL, heights=WRONG)


def test_a_fault_of_a_single_frame_is_not_shown_and_one_that_lasts_is():
    monitor = HealthMonitor()
    assert not monitor.update(FrameHealth((DIM,)), 0.0).findings
    for time_s in (0.2, 0.4):
        assert not monitor.update(FrameHealth(), time_s).findings
    monitor = HealthMonitor()
    shown = [monitor.update(FrameHealth((DIM,)), 0.1 * n).keys for n in range(8)]
    assert shown[0] == ()
    assert shown[-1] == ("exposure",)
    assert monitor.update(FrameHealth(), 1.0).keys == ("exposure",)
    assert monitor.update(FrameHealth(), 9.0).keys == ()


def test_the_worst_comes_first_and_is_named():
    health = health_of([DIM, OFF])
    assert health.keys == ("led_off", "exposure")
    assert health.findings[0].line == "The LED is off. Check it."
    with pytest.raises(InputError, match="the LED"):
        refuse_meaningless(health, where="press.png")
    refuse_meaningless(health_of([DIM]), where="press.png")


def follow(left: list[float], every_s: float = 0.1) -> list[tuple[str, ...]]:
    """Watch a press that leaves a share of itself, and return what is shown of each frame."""
    rng = np.random.default_rng(1)
    press, monitor, shown = np.zeros((300, 3)), HealthMonitor(), []
    press[100:140] = rng.uniform(-0.3, 0.3, (40, 3))
    for n, share in enumerate(left):
        cells = share * press + rng.normal(0.0, 2e-3, press.shape)
        shown.append(monitor.update(FrameHealth(cells=cells), every_s * n).keys)
    return shown


def test_a_gel_that_has_not_recovered_is_reported_until_it_has():
    slow = [1.0] * 10 + [0.08 * 0.5 ** (n / 15) for n in range(90)]
    shown = follow(slow)
    assert ("not_recovered",) in shown[25:40]
    assert shown[-1] == ()
    assert not any(shown[:10])


def test_two_slow_frames_say_nothing_of_a_recovery():
    assert not any(follow([1.0, 0.08, 0.05], every_s=1.5))


@pytest.mark.parametrize("after", [0.0, 0.08])
def test_a_gel_that_has_recovered_and_a_lighter_press_are_not(after):
    assert not any(follow([1.0] * 10 + [after] * 60))
