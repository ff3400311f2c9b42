"""Work goes on in its order, is stopped when asked, and never keeps a page from closing."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from app.shell.jobs import Job, Jobs
from app.sources.stopping import join_left_behind
from gelpolight_core.errors import InputError

Tell = Callable[[float], None]


def test_jobs_are_done_one_after_the_other(qtbot: QtBot) -> None:
    jobs, done = Jobs("jobs"), list[Any]()
    for number in range(3):
        jobs.submit(Job("count", lambda _tell, n=number: n, done.append))
    qtbot.waitUntil(lambda: not jobs.busy)
    assert done == [0, 1, 2]
    assert jobs.close()


class Heavy:
    """Stands for a calibration: what must not wait for Python to look for rings."""


@pytest.fixture
def no_collection() -> Iterator[None]:
    """Nothing but a last reference that goes lets anything go."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_collection")
def test_what_came_of_a_job_belongs_to_who_asked(qtbot: QtBot) -> None:
    jobs, found = Jobs("jobs"), list[weakref.ref[Heavy]]()

    def done(heavy: Heavy) -> None:
        assert job.over
        found.append(weakref.ref(heavy))

    job = Job("read", lambda _tell: Heavy(), done)  # it and `done` refer to each other
    jobs.submit(job)
    qtbot.waitUntil(lambda: bool(found))
    qtbot.waitUntil(lambda: found[0]() is None)
    assert jobs.close()


@pytest.mark.usefixtures("no_collection")
def test_what_a_job_failed_with_is_let_go_once_it_is_told(qtbot: QtBot) -> None:
    jobs, found = Jobs("jobs"), list[weakref.ref[Heavy]]()

    def fail(_tell: Tell) -> None:
        heavy = Heavy()
        found.append(weakref.ref(heavy))
        raise InputError("the picture is grey", where="a.png", advice="Take it in colour")

    with qtbot.waitSignal(jobs.refused):
        jobs.submit(Job("look", fail))
    qtbot.waitUntil(lambda: found[0]() is None)
    assert jobs.close()


def test_a_refusal_is_told_in_one_sentence_and_the_next_job_is_done(qtbot: QtBot) -> None:
    jobs, done = Jobs("jobs"), list[Any]()

    def refuse(_tell: Tell) -> None:
        raise InputError("the picture is grey", where="a.png", advice="Take it in colour")

    with qtbot.waitSignal(jobs.refused) as told:
        jobs.submit(Job("look", refuse))
        jobs.submit(Job("count", lambda _tell: 1, done.append))
    assert "the picture is grey" in told.args[0]
    qtbot.waitUntil(lambda: done == [1])
    assert jobs.close()


def test_what_must_be_done_is_done_though_all_else_is_cancelled() -> None:
    jobs, go, written = Jobs("jobs"), threading.Event(), list[str]()
    jobs.submit(Job("wait", lambda _tell: go.wait(10.0)))
    jobs.submit(Job("compute", lambda _tell: written.append("computed")))
    jobs.submit(Job("save", lambda _tell: written.append("saved"), must=True))
    jobs.cancel()
    go.set()
    assert jobs.close()
    assert written == ["saved"]


def test_work_that_hangs_does_not_keep_the_page_from_closing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    jobs, begun, go = Jobs("hanging"), threading.Event(), threading.Event()

    def hang(_tell: Tell) -> bool:
        begun.set()
        return go.wait(30.0)

    jobs.submit(Job("hang", hang))
    assert begun.wait(10.0)
    assert not jobs.close(timeout_s=0.05)
    assert "hanging did not stop" in caplog.text
    go.set()
    assert join_left_behind(10.0)


def test_what_had_to_be_done_and_failed_is_told_though_its_page_is_closed() -> None:
    jobs, told = Jobs("jobs"), list[str]()
    jobs.refused.connect(told.append)
    go = threading.Event()

    def refuse(_tell: Tell) -> None:
        go.wait(10.0)
        raise InputError("the disk is full", where="a.png", advice="Free some space")

    jobs.submit(Job("save", refuse, must=True))
    jobs.submit(Job("compute", refuse))
    go.set()
    assert jobs.close()
    (sentence,) = told
    assert "the disk is full" in sentence


def test_what_had_to_be_done_and_hangs_is_told_and_done_when_it_can(
    caplog: pytest.LogCaptureFixture,
) -> None:
    jobs, told, written, go = Jobs("jobs"), list[str](), list[str](), threading.Event()
    jobs.refused.connect(told.append)
    jobs.submit(Job("wait", lambda _tell: go.wait(30.0), must=True))
    jobs.submit(Job("save", lambda _tell: written.append("saved"), must=True))
    jobs.submit(Job("keep", lambda _tell: written.remove("nothing"), must=True))
    assert not jobs.close(timeout_s=0.05)
    assert [sentence.partition(":")[0] for sentence in told] == ["wait", "save", "keep"]
    assert "save was not done when it was closed" in caplog.text
    go.set()
    assert join_left_behind(10.0)
    assert written == ["saved"]
    assert "keep failed after it was closed" in caplog.text


@pytest.mark.parametrize("end", ["done", "refused", "faulty", "stopped", "dropped"])
def test_who_asked_is_told_that_a_job_ended_however_it_did(end: str, qtbot: QtBot) -> None:
    jobs, ended, go = Jobs("jobs"), list[str](), threading.Event()

    def work(tell: Tell) -> None:
        if end == "refused":
            raise InputError("the picture is grey", where="a.png", advice="Take it in colour")
        if end == "faulty":
            raise ValueError("nobody thought of this")
        assert go.wait(10.0)
        tell(0.5)

    if end == "dropped":
        jobs.submit(Job("first", lambda _tell: go.wait(10.0)))
    jobs.submit(Job("export", work, ended=lambda: ended.append(end)))
    if end in ("stopped", "dropped"):
        jobs.cancel()
    go.set()
    qtbot.waitUntil(lambda: not jobs.busy)
    assert ended == [end]
    assert jobs.close()


@pytest.mark.parametrize("runs", [True, False])
def test_who_asked_is_told_that_a_job_was_stopped(runs: bool, qtbot: QtBot) -> None:
    jobs, told, refused = Jobs("jobs"), list[str](), list[str]()
    begun, go = threading.Event(), threading.Event()
    jobs.refused.connect(refused.append)

    def work(tell: Tell) -> None:
        begun.set()
        assert go.wait(10.0)
        tell(0.5)

    if not runs:
        jobs.submit(Job("first", lambda _tell: go.wait(10.0)))
    jobs.submit(Job("export", work, stopped=told.append))
    if runs:
        assert begun.wait(10.0)
    jobs.cancel()
    go.set()
    qtbot.waitUntil(lambda: not jobs.busy)
    assert told == ["export: stopped"]
    assert not refused
    assert jobs.close()
