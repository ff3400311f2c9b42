"""Modules that take long to load are loaded beside the window, which answers meanwhile."""

from __future__ import annotations

import importlib
import logging
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable

from PySide6.QtCore import QObject, Qt, Signal

_LOG = logging.getLogger(__name__)


class Loader(QObject):
    """Imports modules one after the other in a thread of its own, which ends with the last."""

    _loaded = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._queue: deque[str] = deque()
        self._done: set[str] = set()
        self._thread: threading.Thread | None = None
        self._waiting: list[tuple[frozenset[str], Callable[[], object]]] = []
        self._loaded.connect(self._call_those_who_waited, Qt.ConnectionType.QueuedConnection)

    def load(self, modules: Iterable[str]) -> None:
        """Load modules after all that were asked for before."""
        with self._lock:
            self._queue.extend(modules)
        self._run_thread()

    def when_loaded(self, modules: Iterable[str], then: Callable[[], object]) -> None:
        """Call `then` in this thread once modules are there: now, or when they are loaded.

        They are loaded before all others. A module that cannot be loaded counts as loaded:
        whoever imports it is told why.
        """
        missing = [name for name in modules if not self._is_there(name)]
        if not missing:
            then()
            return
        self._waiting.append((frozenset(missing), then))
        with self._lock:
            self._queue.extendleft(reversed(missing))
        self._run_thread()

    def stop(self) -> None:
        """Leave out what is not begun, call nobody any more, and wait for the module at work."""
        self._waiting.clear()
        with self._lock:
            self._queue.clear()
            thread = self._thread
        if thread is not None:
            thread.join()

    def _is_there(self, name: str) -> bool:
        """Whether a module is loaded as a whole; while others load, it may be half of itself."""
        with self._lock:
            return name in self._done or (self._thread is None and name in sys.modules)

    def _run_thread(self) -> None:
        with self._lock:
            if self._thread is None and self._queue:
                self._thread = threading.Thread(target=self._run, name="loader", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._queue:
                    self._thread = None
                    return
                name = self._queue.popleft()
            try:
                importlib.import_module(name)
            except Exception:  # raised again where the module is used, in the window's thread
                _LOG.exception("The module %s cannot be loaded", name)
            with self._lock:
                self._done.add(name)
            self._loaded.emit()

    def _call_those_who_waited(self) -> None:
        with self._lock:
            done = frozenset(self._done)
        ready = [then for missing, then in self._waiting if missing <= done]
        self._waiting = [(missing, then) for missing, then in self._waiting if not missing <= done]
        for then in ready:
            then()
