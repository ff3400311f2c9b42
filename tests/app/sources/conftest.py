"""Small virtual sensors, and a watch over threads that were left behind."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from app.sources.bench import Bench
from gelpolight_core.design.sensor_design import SensorDesign


@pytest.fixture
def bench() -> Bench:
    """Return a bench whose pictures have 320 x 240 pixels."""
    return Bench(SensorDesign().scaled(0.25), seed=3)


@pytest.fixture(autouse=True)
def no_thread_stays() -> Iterator[None]:
    """Fail a test after which a thread still runs that did not run before."""
    before = set(threading.enumerate())
    yield
    left = [thread.name for thread in threading.enumerate() if thread not in before]
    assert not left, f"threads still running: {left}"
