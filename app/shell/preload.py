"""Modules that take long to load are loaded while the person looks at the first page."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Sequence


class Preload:
    """Imports modules one after the other in a thread of its own.

    A page that is opened meanwhile waits for its own module alone.

    Parameters
    ----------
    modules : sequence of str
        In the order in which they will be needed; each must exist.
    """

    def __init__(self, modules: Sequence[str]) -> None:
        self._modules = tuple(modules)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="preload", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Leave out what is not yet begun, and wait for the rest."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        for module in self._modules:
            if self._end.is_set():
                return
            importlib.import_module(module)
