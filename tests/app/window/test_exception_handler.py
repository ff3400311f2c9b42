"""Every internal error is reported, and no user sees a traceback."""

import logging
import sys
import threading

import pytest
from PySide6.QtWidgets import QWidget

from app.program.context import AppContext
from app.program.log import CRASHES, NAME, Log
from app.window.desktop import ExceptionHandler


@pytest.fixture
def faults(context, qtbot):
    host = QWidget()
    qtbot.addWidget(host)
    context.toasts.attach(host, lambda: None)
    made = ExceptionHandler(context.toasts)
    made.install()
    yield made
    made.uninstall()


def log_of(context: AppContext) -> str:
    return (context.log.folder / NAME).read_text("utf-8")


@pytest.mark.function("Read one sentence after an internal error, with the details in the log")
def test_an_internal_error_is_one_sentence_and_the_log_has_the_traceback(faults, context):
    try:
        {}["lens"]
    except KeyError as error:
        sys.excepthook(KeyError, error, error.__traceback__)
    (toast,) = context.toasts.shown()
    assert "nternal error" in toast.text
    assert "Traceback" not in toast.text
    assert "Traceback" in log_of(context)


def test_errors_in_threads_and_destructors_are_shown_and_equal_ones_once(faults, context, qtbot):
    def fail() -> None:
        raise ZeroDivisionError("in the capture thread")

    class Fails:
        def __del__(self) -> None:
            raise ValueError("while it was deleted")

    thread = threading.Thread(target=fail, name="capture")
    thread.start()
    thread.join()
    qtbot.waitUntil(lambda: len(context.toasts.shown()) == 1)
    assert "in the capture thread" in context.toasts.shown()[0].text
    assert "capture" in log_of(context)
    Fails()
    assert "while it was deleted" in context.toasts.shown()[-1].text
    for _ in range(1000):
        sys.excepthook(ValueError, ValueError("the same again"), None)
    assert len(context.toasts.shown()) == 3


def test_a_crash_of_the_last_run_is_noticed_once(tmp_path):
    for expected in (True, False):
        if expected:
            (tmp_path / CRASHES).write_text("Fatal Python error: Segmentation fault")
        log = Log(tmp_path)
        assert bool(log.start()) is expected
        log.stop()
    assert "Segmentation fault" in (tmp_path / "gelpolight.log").read_text()


def test_a_log_folder_that_cannot_be_written_is_replaced(tmp_path):
    (tmp_path / "file").write_text("")
    log = Log(tmp_path / "file")
    log.start()
    log.stop()
    assert log.folder != tmp_path / "file"
    assert (log.folder / "gelpolight.log").is_file()


def test_details_of_libraries_are_dropped_and_their_warnings_kept(context):
    """Otherwise one PDF would fill hundreds of lines with messages about fonts."""
    for name in ("fontTools.subset", "app.inspect", "gelpolight_core.output.report"):
        logging.getLogger(name).info("a step of %s", name)
        logging.getLogger(name).warning("trouble in %s", name)
    output = log_of(context)
    assert "a step of fontTools" not in output
    assert "trouble in fontTools" in output
    assert "a step of app.inspect" in output
    assert "a step of gelpolight_core" in output
