"""The line above the views: what is missing and what to do, or how long work gets on."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QPushButton, QSizePolicy, QWidget

from app.widgets.label import PlainLabel
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr

# Work that is done at once needs no progress.
TELL_FROM = 0.005


class Banner(QWidget):
    """Says what to do next; its room is its own, so that nothing moves when it has nothing to say.

    Parameters
    ----------
    idle : str
        Said quietly where there is nothing else.

    Signals
    -------
    act_wanted(str)
        The button beside the advice was pressed; its name.
    stop_wanted()
        The work shall be stopped.
    """

    act_wanted = Signal(str)
    stop_wanted = Signal()

    def __init__(self, idle: str = "") -> None:
        super().__init__()
        named(self, "inspect.banner", tr("What to do next"))
        self._act, self._advice, self._role = "", "", ""
        self._idle = idle
        self._text = named(PlainLabel(), "inspect.advice", tr("Advice"))
        self._text.setWordWrap(True)
        self._text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._button = named(QPushButton(), "inspect.advised", tr("Do that"))
        self._button.clicked.connect(lambda: self.act_wanted.emit(self._act))
        self._bar = named(QProgressBar(), "inspect.progress", tr("Progress"))
        self._bar.setFixedWidth(220)
        self._stop = named(QPushButton(tr("Stop")), "inspect.stop", tr("Stop the work"))
        self._stop.clicked.connect(self.stop_wanted)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 4, 10, 4)
        for widget in (self._text, self._button, self._bar, self._stop):
            row.addWidget(widget)
        lines = 2 * self._text.fontMetrics().lineSpacing()
        self.setFixedHeight(max(lines, self._button.sizeHint().height()) + 8)
        self._working = False
        self._show()

    def advise(self, text: str, act: tuple[str, str] = ("", ""), *, role: str = "") -> None:
        """Say something, with a button (name, text) that does it; empty: nothing."""
        self._advice, self._act, self._role = text, act[0], role
        self._button.setText(act[1])
        self._show()

    def show_work(self, title: str, share: float) -> None:
        """Show how work gets on; an empty title: there is none."""
        self._working = bool(title) and share >= TELL_FROM
        self._bar.setValue(round(100.0 * share))
        if self._working:
            self._text.setText(tr("{title}…").format(title=title))
        self._show()

    def _show(self) -> None:
        role = "" if self._working else self._role
        if not self._working:
            self._text.setText(self._advice or self._idle)
            role = role if self._advice else "muted"
        show_meaning(self._text, role)
        self._button.setVisible(bool(self._act) and not self._working)
        self._bar.setVisible(self._working)
        self._stop.setVisible(self._working)
