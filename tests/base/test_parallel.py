"""Work on several threads: results in order, errors and stops passed on."""

import threading
import time

import pytest

from gelpolight_core.base import parallel
from gelpolight_core.base.parallel import in_parallel


@pytest.fixture(autouse=True)
def _cores(monkeypatch):
    monkeypatch.setattr(parallel, "usable_cores", lambda: 4)


def test_results_come_in_the_order_of_the_items():
    def slow_first(n: int) -> int:
        time.sleep(0.02 * (3 - n))
        return n * n

    assert list(in_parallel(slow_first, range(4))) == [0, 1, 4, 9]


def test_the_error_of_the_first_failing_item_is_raised():
    with pytest.raises(ValueError, match="item 2"):
        list(in_parallel(_fail_from_two, range(6)))


def _fail_from_two(n: int) -> int:
    if n >= 2:
        raise ValueError(f"item {n}")
    return n


def test_what_was_not_begun_is_left_out_when_the_caller_stops():
    begun = []

    def work(n: int) -> int:
        begun.append(n)
        time.sleep(0.02)
        return n

    results = in_parallel(work, range(100))
    assert next(results) == 0
    results.close()
    assert len(begun) < 20
    assert not any(thread.name.startswith("parallel") for thread in threading.enumerate())
