"""Threads that give way to the window."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from app.sources.priority import PROCESSING, give_way


@pytest.mark.skipif(sys.platform != "linux", reason="threads have a priority of their own on Linux")
def test_a_thread_that_gives_way_leaves_the_others_as_they_are() -> None:
    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    seen: list[int] = []

    def work() -> None:
        give_way(PROCESSING)
        seen.append(niceness())

    before = niceness()
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [min(before + PROCESSING, 19)]
    assert niceness() == before
