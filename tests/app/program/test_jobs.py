"""Jobs run in order, can be stopped, and never keep a page from closing."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from app.program.jobs import BackgroundJob, JobQueue
from app.sources.stoppable_thread import join_unfinished_threads
from gelpolight_core.base.errors import InputError

Tell = Callable[[float], None]


def test_an_error_is_one_sentence_and_the_next_job_runs(qtbot):
    jobs, done = JobQueue("jobs"), list[Any]()

    def refuse(_progress: Tell) -> None:
        raise InputError("the image is grey", where="a.png", advice="Take it in colour")

    with qtbot.waitSignal(jobs.refused) as reported:
        jobs.submit(BackgroundJob("look", refuse))
        jobs.submit(BackgroundJob("count", lambda _progress: 1, done.append))
    assert "the image is grey" in reported.args[0]
    qtbot.waitUntil(lambda: done == [1])
    assert jobs.close()


def test_required_jobs_run_when_all_others_are_cancelled():
    jobs, go, written = JobQueue("jobs"), threading.Event(), list[str]()
    jobs.submit(BackgroundJob("wait", lambda _progress: go.wait(60.0)))
    jobs.submit(BackgroundJob("compute", lambda _progress: written.append("computed")))
    jobs.submit(BackgroundJob("save", lambda _progress: written.append("saved"), must=True))
    jobs.cancel()
    go.set()
    assert jobs.close()
    assert written == ["saved"]


def test_a_hanging_job_does_not_block_closing(caplog):
    jobs, begun, go = JobQueue("hanging"), threading.Event(), threading.Event()

    def hang(_progress: Tell) -> bool:
        begun.set()
        return go.wait(60.0)

    jobs.submit(BackgroundJob("hang", hang))
    assert begun.wait(60.0)
    assert not jobs.close(timeout_s=0.05)
    assert "hanging did not stop" in caplog.text
    go.set()
    assert join_unfinished_threads(10.0)


def test_a_hanging_required_job_is_reported_and_still_completed(caplog):
    jobs, reported, written, go = JobQueue("jobs"), list[str](), list[str](), threading.Event()
    jobs.refused.connect(reported.append)
    jobs.submit(BackgroundJob("wait", lambda _progress: go.wait(60.0), must=True))
    jobs.submit(BackgroundJob("save", lambda _progress: written.append("saved"), must=True))
    jobs.submit(BackgroundJob("keep", lambda _progress: written.remove("nothing"), must=True))
    assert not jobs.close(timeout_s=0.05)
    assert [sentence.partition(":")[0] for sentence in reported] == ["wait", "save", "keep"]
    assert "save had not finished when the page closed" in caplog.text
    go.set()
    assert join_unfinished_threads(10.0)
    assert written == ["saved"]
    assert "keep failed after it was closed" in caplog.text


@pytest.mark.parametrize("end", ["done", "refused", "faulty", "stopped", "dropped"])
def test_the_caller_is_notified_however_a_job_ends(end, qtbot):
    jobs, ended, stopped, refused = JobQueue("jobs"), list[str](), list[str](), list[str]()
    begun, go = threading.Event(), threading.Event()
    jobs.refused.connect(refused.append)

    def work(progress: Tell) -> None:
        begun.set()
        if end == "refused":
            raise InputError("the image is grey", where="a.png", advice="Take it in colour")
        if end == "faulty":
            raise ValueError("nobody thought of this")
        assert go.wait(60.0)
        progress(0.5)

    if end == "dropped":
        jobs.submit(BackgroundJob("first", lambda _progress: go.wait(10.0)))
    jobs.submit(
        BackgroundJob("export", work, ended=lambda: ended.append(end), stopped=stopped.append)
    )
    if end == "stopped":
        assert begun.wait(10.0)
    if end in ("stopped", "dropped"):
        jobs.cancel()
    go.set()
    qtbot.waitUntil(lambda: not jobs.busy)
    assert ended == [end]
    assert stopped == (["export: stopped"] if end in ("stopped", "dropped") else [])
    assert bool(refused) is (end in ("refused", "faulty"))
    assert jobs.close()
