"""Threads with a lower priority than the window."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from app.sources.priority import PROCESSING, lower_priority


@pytest.mark.skipif(sys.platform != "linux", reason="threads have a priority of their own on Linux")
def test_lower_priority_affects_only_its_own_thread() -> None:
    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    seen: list[int] = []

    def work() -> None:
        lower_priority(PROCESSING)
        seen.append(niceness())

    before = niceness()
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [min(before + PROCESSING, 19)]
    assert niceness() == before
