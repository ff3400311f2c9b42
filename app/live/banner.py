"""The advice on the next step, in a line above the views or over them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QProgressBar, QPushButton, QSizePolicy, QWidget

from app.program.jobs import JobQueue
from app.widgets.actions import push_button
from app.widgets.layout import hbox
from app.widgets.text_roles import named_label, set_background_role, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.finding import Finding, Verdict

from .next_step_advice import BUTTONS, action_of, is_of_another

# Short work needs no progress bar.
SHOWN_FROM = 0.005
ROLES = {Verdict.PASS: "text", Verdict.WARN: "warn", Verdict.FAIL: "fail"}


class AdviceBanner(QWidget):
    """Shows what to do next. Two lines are reserved, so that nothing moves when it is empty.

    Parameters
    ----------
    jobs : JobQueue
        Their progress is shown, and they can be stopped.
    idle : str
        Shown in muted colour if there is no advice.
    on_act : callable
        Called with the name of the advised action when its button is clicked.
    over : QWidget
        The views. If the calibration in use is for other images, their upper edge says so.
    """

    def __init__(
        self, jobs: JobQueue, *, idle: str, on_act: Callable[[str], object], over: QWidget
    ) -> None:
        super().__init__()
        set_names(self, "inspect.banner", "What to do next")
        self._advice: Finding | None = None
        self._idle = idle
        self._text = named_label("inspect.advice", "Advice", text="\n")
        stretch = self._text.sizePolicy()  # with its height for a width
        stretch.setHorizontalPolicy(QSizePolicy.Policy.Expanding)
        self._text.setSizePolicy(stretch)
        self._button = set_names(QPushButton(), "inspect.advised", "Do this")
        self._button.clicked.connect(lambda: on_act(action_of(self._advice)))
        self._bar = set_names(QProgressBar(), "inspect.progress", "Progress")
        self._bar.setFixedWidth(220)
        self._stop = push_button("inspect.stop", "Stop", jobs.cancel, accessible="Stop the work")
        jobs.progressed.connect(self.show_work)
        self._line = QWidget()
        self._line.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        hbox((self._text, 1), self._button, of=self._line, margins=(10, 4, 10, 4))
        self._row = hbox((self._line, 1), self._bar, self._stop, of=self, margins=(0, 0, 10, 0))
        self._over = over
        over.installEventFilter(self)
        lines, button = self._text.sizeHint().height(), self._button.sizeHint().height()
        self.setMinimumHeight(max(lines, button) + 8)
        self._working = False
        self._show()

    def advise(self, advice: Finding | None, *, idle: str = "") -> None:
        """Show an advice, with a button for its action. `idle` replaces the earlier text."""
        self._advice, self._idle = advice, idle or self._idle
        self._button.setText(BUTTONS.get(action_of(advice), ""))
        self._show()

    def show_work(self, title: str, share: float) -> None:
        """Show the progress of work. An empty title: no work is running."""
        self._working = bool(title) and share >= SHOWN_FROM
        self._bar.setValue(round(100.0 * share))
        if self._working:
            self._text.setText(f"{title}…")
        self._show()

    def _show(self) -> None:
        advice, role = self._advice, ""
        if not self._working:
            self._text.setText(self._idle if advice is None else advice.line)
            role = "muted" if advice is None else ROLES[advice.verdict]
        self._put_line(over=is_of_another(advice) and not self._working)
        set_text_role(self._text, role)
        self._button.setVisible(bool(action_of(advice)) and not self._working)
        self._bar.setVisible(self._working)
        self._stop.setVisible(self._working)

    def _put_line(self, *, over: bool) -> None:
        """Put text and button over the views, or back into this line."""
        views = self._over.parentWidget()
        if over == (self._line.parent() is views):
            return
        set_background_role(self._line, "fail" if over else "")
        if over:
            self._line.setParent(views)
            self._place()
            self._line.show()
        else:
            self._row.insertWidget(0, self._line, 1)

    def _place(self) -> None:
        area = self._over.geometry()
        height = max(self._line.heightForWidth(area.width()), self.height())
        self._line.setGeometry(area.x(), area.y(), area.width(), height)
        self._line.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        moved = event.type() in (QEvent.Type.Resize, QEvent.Type.Move, QEvent.Type.Show)
        if moved and self._line.parent() is not self:
            self._place()
        return super().eventFilter(watched, event)
