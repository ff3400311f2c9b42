"""Loads slow modules in the background, and the view that is shown meanwhile."""

from __future__ import annotations

import importlib
import logging
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QProgressBar, QWidget

from app.widgets.layout import vbox
from app.widgets.text_roles import named_label
from app.widgets.widget_names import set_names

_LOG = logging.getLogger(__name__)


class ModuleLoader(QObject):
    """Imports modules one after the other in its own thread, which ends after the last one."""

    _loaded = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._queue: deque[str] = deque()
        self._done: set[str] = set()
        self._thread: threading.Thread | None = None
        self._stopped = False
        self._waiting: list[tuple[frozenset[str], Callable[[], object]]] = []
        self._loaded.connect(self._run_callbacks, Qt.ConnectionType.QueuedConnection)

    def load(self, modules: Iterable[str]) -> None:
        """Load modules after all earlier requests."""
        with self._lock:
            self._queue.extend(modules)
        self._run_thread()

    def when_loaded(self, modules: Iterable[str], then: Callable[[], object]) -> None:
        """Call `then` in this thread when the modules are loaded, at once if they already are.

        They are loaded before all others. A module that cannot be loaded counts as loaded: the code
        that imports it gets the error.
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
        """Load nothing more, call no callbacks, and wait for the current module."""
        self._waiting.clear()
        with self._lock:
            self._queue.clear()
            self._stopped = True
            thread = self._thread
        if thread is not None:
            thread.join()

    def _is_there(self, name: str) -> bool:
        """Whether a module is completely loaded, not only partly as during its import."""
        with self._lock:
            return name in self._done or (self._thread is None and name in sys.modules)

    def _run_thread(self) -> None:
        with self._lock:
            if self._queue and self._thread is None and not self._stopped:
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
            except Exception:  # raised again in the window's thread when the module is used
                _LOG.exception("The module %s cannot be loaded", name)
            with self._lock:
                self._done.add(name)
            self._loaded.emit()

    def _run_callbacks(self) -> None:
        with self._lock:
            done = frozenset(self._done)
        ready = [then for missing, then in self._waiting if missing <= done]
        self._waiting = [(missing, then) for missing, then in self._waiting if not missing <= done]
        for then in ready:
            then()


class LoadingView(QWidget):
    """A title and a moving progress bar."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "main.loading", "Page is loading")
        self._text = named_label("main.loading.text", "Page being loaded", wrap=False)
        self._text.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        bar = set_names(QProgressBar(minimum=0, maximum=0), "main.loading.bar", "Page is loading")
        bar.setFixedWidth(320)
        vbox(self._text, bar, of=self).setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_message(self, title: str) -> None:
        """Show the name of the page."""
        self._text.setText(f"Loading {title}…")
