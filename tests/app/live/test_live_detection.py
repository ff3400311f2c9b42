"""A detector that runs longer than its page: its thread must not be the last to hold a QObject."""

import gc
import threading
import weakref

import numpy as np
from PySide6.QtCore import QCoreApplication, QEvent
from test_live_session import Camera

from app.live.live_detection import LiveDetection
from app.live.live_session import LiveSession
from app.sources.stoppable_thread import join_unfinished_threads

WAIT_S = 60.0


def test_a_slow_detector_does_not_keep_the_page_alive(context):
    """Otherwise its thread would delete Qt objects, which only the GUI thread may do."""
    camera = Camera()
    context.source.choose(camera.info)
    session = LiveSession(context=context, name="slow")
    detection = LiveDetection(session)
    begun, go_on = threading.Event(), threading.Event()

    def slow(_rgb: np.ndarray) -> None:
        begun.set()
        go_on.wait(WAIT_S)

    detection.set_detector(slow)
    session.enter(True)
    assert begun.wait(WAIT_S)
    session.finish()  # leaves the thread behind after a second
    there = weakref.ref(detection), weakref.ref(session)
    session.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    context.source.choose(None)
    del session, detection
    gc.collect()
    assert [ref() for ref in there] == [None, None]
    go_on.set()
    assert join_unfinished_threads(WAIT_S)
