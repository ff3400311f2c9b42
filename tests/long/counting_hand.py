"""A hand with mouse and keyboard at the program's window; it counts what it does."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

from PySide6.QtCore import QEventLoop, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QListWidget, QScrollArea, QWidget

from app.shell.main_window import MainWindow
from app.widgets.qt_tree import below

POLL_MS = 20
PATIENCE_S = 300.0
# A person reads, moves the mouse, and then clicks.
REACTION_S = 1.0
SELECT_ALL = "Ctrl+A"


class CountingHand:
    """Clicks where a widget is seen, through the window, as a mouse does.

    Attributes
    ----------
    counts : Counter of str
        Actions of each step: clicks, key chords, and entries into a field.
    seconds : dict of str to float
        Time of each step.
    """

    def __init__(self, window: MainWindow) -> None:
        self.window = window
        self.counts: Counter[str] = Counter()
        self.seconds: dict[str, float] = {}
        self._step, self._since_s = "", time.monotonic()

    def begin(self, step: str) -> None:
        """Count for another step from now on."""
        now_s = time.monotonic()
        if self._step:
            self.seconds[self._step] = self.seconds.get(self._step, 0.0) + now_s - self._since_s
        self._step, self._since_s = step, now_s

    def until(self, done: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
        """Wait for something.

        Raises
        ------
        TimeoutError
            If it does not come.
        """
        end_s = time.monotonic() + patience_s
        loop, poll, seen = QEventLoop(), QTimer(), []

        def check() -> None:
            if done():
                seen.append(True)
            if seen or time.monotonic() > end_s:
                loop.quit()

        poll.timeout.connect(check)
        poll.start(POLL_MS)
        loop.exec()
        poll.stop()
        if not seen:
            raise TimeoutError(f"waited {patience_s:.0f} s in vain: {what}")

    def pause(self, seconds: float = REACTION_S) -> None:
        """Do nothing for a while."""
        end_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end_s, "time passes")

    def see(self, name: str) -> QWidget | None:
        """Return the visible widget of a name, or None."""
        windows = [w for w in QApplication.topLevelWidgets() if w.isVisible()]
        found = (w for window in windows for w in below(window, QWidget, name))
        return next((widget for widget in found if widget.isVisible()), None)

    def click(self, name: str) -> None:
        """Click on a widget as soon as it is seen and enabled; scrolling to it is an action."""
        self.until(lambda: self._ready(name), f"{name} can be clicked")
        widget = self.see(name)
        assert widget is not None
        self.pause()
        self._scroll_to(widget)
        self.counts[self._step] += 1
        window = widget.window()
        place = widget.mapTo(window, widget.rect().center())
        over = window.childAt(place)
        if over is not widget and not widget.isAncestorOf(over):
            raise LookupError(f"{name} is covered by {over and over.objectName()}")
        QTest.mouseClick(window.windowHandle(), Qt.MouseButton.LeftButton, pos=place)

    def click_item(self, items: QListWidget, row: int) -> None:
        """Click on an item of a list."""
        self.pause()
        self.counts[self._step] += 1
        items.scrollToItem(items.item(row))
        place = items.visualItemRect(items.item(row)).center()
        QTest.mouseClick(items.viewport(), Qt.MouseButton.LeftButton, pos=place)

    def enter(self, name: str, text: str) -> None:
        """Click into a field and type: one action."""
        self.click(name)
        widget = self.see(name)
        assert widget is not None
        QTest.keySequence(widget, SELECT_ALL)
        QTest.keyClicks(widget, text)
        QTest.keyClick(widget, Qt.Key.Key_Return)

    def table(self) -> str:
        """Return actions and time of each step, and their sums."""
        self.begin("")
        rows = [f"{step:<16}{self.counts[step]:>8}{s:>9.1f}" for step, s in self.seconds.items()]
        minutes = sum(self.seconds.values()) / 60.0
        total = f"{'all':<16}{self.counts.total():>8}{60.0 * minutes:>9.1f}  = {minutes:.1f} min"
        return "\n".join((f"{'step':<16}{'actions':>8}{'seconds':>9}", *rows, total))

    def _ready(self, name: str) -> bool:
        widget = self.see(name)
        return widget is not None and widget.isEnabled()

    def _scroll_to(self, widget: QWidget) -> None:
        if widget.visibleRegion().contains(widget.rect().center()):
            return
        ancestor = widget.parentWidget()
        while ancestor is not None and not isinstance(ancestor, QScrollArea):
            ancestor = ancestor.parentWidget()
        if ancestor is None:
            raise LookupError(f"{widget.objectName()} is hidden")
        self.counts[self._step] += 1
        ancestor.ensureWidgetVisible(widget)
        QApplication.processEvents()
