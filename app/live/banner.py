"""The line above the views: what to do next, or the progress of work."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QProgressBar, QPushButton, QSizePolicy, QWidget

from app.live.advice import BUTTONS, action_of
from app.services.jobs import Jobs
from app.widgets.buttons import push_button
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.translation import tr

# Short work needs no progress bar.
SHOWN_FROM = 0.005
ROLES = {Verdict.PASS: "text", Verdict.WARN: "warn", Verdict.FAIL: "fail"}


class Banner(QWidget):
    """Shows what to do next. Its space is reserved, so that nothing moves when it is empty.

    Parameters
    ----------
    jobs : Jobs
        Their progress is shown, and they can be stopped.
    idle : str
        Shown in muted colour if there is no advice.
    on_act : callable
        Called with the name of the advised action when its button is clicked.
    """

    def __init__(self, jobs: Jobs, *, idle: str, on_act: Callable[[str], object]) -> None:
        super().__init__()
        named(self, "inspect.banner", tr("What to do next"))
        self._advice: Finding | None = None
        self._idle = idle
        self._text = named(PlainLabel(wrap=True), "inspect.advice", tr("Advice"))
        self._text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._button = named(QPushButton(), "inspect.advised", tr("Do this"))
        self._button.clicked.connect(lambda: on_act(action_of(self._advice)))
        self._bar = named(QProgressBar(), "inspect.progress", tr("Progress"))
        self._bar.setFixedWidth(220)
        self._stop = push_button(
            "inspect.stop", tr("Stop"), jobs.cancel, accessible=tr("Stop the work")
        )
        jobs.progressed.connect(self.show_work)
        hbox(self._text, self._button, self._bar, self._stop, of=self, margins=(10, 4, 10, 4))
        line, button = self._text.fontMetrics().lineSpacing(), self._button.sizeHint().height()
        self.setFixedHeight(max(2 * line, button) + 8)
        self._working = False
        self._show()

    def advise(self, advice: Finding | None) -> None:
        """Show an advice, with a button for its action."""
        self._advice = advice
        self._button.setText(BUTTONS.get(action_of(advice), ""))
        self._show()

    def show_work(self, title: str, share: float) -> None:
        """Show the progress of work. An empty title: no work is running."""
        self._working = bool(title) and share >= SHOWN_FROM
        self._bar.setValue(round(100.0 * share))
        if self._working:
            self._text.setText(tr("{title}…").format(title=title))
        self._show()

    def _show(self) -> None:
        advice, role = self._advice, ""
        if not self._working:
            self._text.setText(self._idle if advice is None else advice.line)
            role = "muted" if advice is None else ROLES[advice.verdict]
        # A text that is longer than the banner starts in it, and the tooltip shows all of it.
        room = self._text.rect().adjusted(0, 0, 0, 10 * self.height())
        wrap = Qt.TextFlag.TextWordWrap
        shown = self._text.fontMetrics().boundingRect(room, wrap, self._text.text())
        fits = shown.height() <= self._text.height()
        vertical = Qt.AlignmentFlag.AlignVCenter if fits else Qt.AlignmentFlag.AlignTop
        self._text.setAlignment(Qt.AlignmentFlag.AlignLeft | vertical)
        self._text.setToolTip(plain_tip(self._text.text()))
        show_meaning(self._text, role)
        self._button.setVisible(bool(action_of(advice)) and not self._working)
        self._bar.setVisible(self._working)
        self._stop.setVisible(self._working)
