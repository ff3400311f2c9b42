"""The side panel of a step: its task, its one number, its one cause, and its buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import isfinite

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QFrame,
    QMenu,
    QProgressBar,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.film_strip import Capture
from app.calibrate.states import RUNNING, state_icon, state_meaning, state_word
from app.calibrate.step_data import Step
from app.calibrate.step_help import StepHelp
from app.widgets.actions import make_action
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, keep_space, scroll_area, vbox
from app.widgets.meaning import make_bold, show_ground, show_meaning
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from app.widgets.sign import Sign
from gelpolight_core.finding import Finding, QualityTable, value_text
from gelpolight_core.translation import tr

WIDTH = 304
# This space is always reserved, so that nothing moves when a message changes.
HINT_LINES = 4
NUMBER_LINES = 3
REMEDIES = 3
"""As many as the panel has room for."""
LEAST_CAPTURES = 2
"""With fewer captures there is nothing to compare."""

Remedy = tuple[str, Callable[[], object]]
"""Text of a button, and what it does."""


class StepPanel(QWidget):
    """The side panel of a step; its lower part is always visible and never moves.

    Attributes
    ----------
    finished : bool
        Whether the step is complete.
    step : Step
        The shown step.
    worst : str
        Name of the capture with the largest residual.
    """

    step: Step | None = None

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.panel", tr("This step"))
        self.setFixedWidth(WIDTH)
        self.finished = False
        self._following = ""
        self._remedies: dict[str, Callable[[], object]] = {}
        inside = QWidget()
        self._scroll = named(scroll_area(inside), "calibrate.panel.scroll", tr("This step"))
        self._scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._extra = QVBoxLayout()
        self._column = vbox(
            *self._build_head(),
            self._build_number(),
            self._extra,
            self._build_message(),
            self._build_details(),
            None,
            of=inside,
            margins=(16, 16, 16, 8),
            spacing=12,
        )
        vbox((self._scroll, 1), self._build_foot(), of=self, margins=0, spacing=0)

    def _build_head(self) -> tuple[object, ...]:
        self.title = named(PlainLabel(), "calibrate.title", tr("Step"))
        make_bold(self.title, size=1.5)
        self.task = named(PlainLabel(wrap=True), "calibrate.task", tr("Task"))
        self.help = StepHelp()
        return hbox((self.title, 1), self.help, margins=0), self.task

    def _build_number(self) -> QFrame:
        self.caption = named(
            PlainLabel(wrap=True), "calibrate.number.caption", tr("Figure of this step")
        )
        self.number = named(PlainLabel(), "calibrate.number", tr("Its value"))
        make_bold(self.number, size=1.6)
        self._sign = Sign()
        self._word = named(PlainLabel(), "calibrate.state", tr("State of the step"))
        make_bold(self._word)
        self.below = named(PlainLabel(wrap=True), "calibrate.count", tr("Captures of this step"))
        self.details = named(QToolButton(), "calibrate.details", tr("Figures of this step"))
        self.details.setText(tr("Details"))
        self.details.setCheckable(True)
        words = QWidget()
        words.setFixedHeight(NUMBER_LINES * words.fontMetrics().lineSpacing())
        vbox(self.caption, self.below, None, of=words, margins=0, spacing=0)
        for label in (self.caption, self.below):
            show_meaning(label, "muted")
        return card(
            hbox((self.number, 1), self._sign, self._word, margins=0, spacing=4),
            words,
            hbox(None, self.details, margins=0),
        )

    def _build_message(self) -> QFrame:
        """Return the card of what is wrong; an action that failed comes before the step's state."""
        self.notice = named(_message(), "calibrate.notice", tr("Result of the last action"))
        self.sentence = named(_message(), "calibrate.sentence", tr("Message about the step"))
        self.buttons = [
            named(QPushButton(), f"calibrate.remedy{place}", tr("Remedy"))
            for place in range(REMEDIES)
        ]
        for button in self.buttons:
            button.clicked.connect(lambda _on=False, b=button: self._remedies[b.text()]())
        self._message = card(self.notice, self.sentence, *self.buttons)
        return self._message

    def _build_details(self) -> QWidget:
        self.quality = QualityTableWidget(
            "calibrate.quality", tr("Quality figures of this step"), narrow=True
        )
        self.residual = named(PlainLabel(), "calibrate.residual", tr("Residual"))
        make_bold(self.residual)
        self.residuals = QualityTableWidget(
            "calibrate.residuals", tr("Captures, worst first"), narrow=True
        )
        self.repeat = named(
            QPushButton(tr("Repeat the &worst")),
            "calibrate.residuals.repeat",
            tr("Repeat the worst capture"),
            tr("Exclude the capture with the largest residual, and capture a new one"),
        )
        details = QWidget()
        vbox(self.quality, self.residual, self.residuals, self.repeat, of=details, margins=0)
        details.hide()
        self.details.toggled.connect(details.setVisible)
        return details

    def _build_foot(self) -> QWidget:
        self.lay = named(
            QPushButton(tr("Place it on the virtual &bench")),
            "calibrate.lay",
            tr("Place the object for this step on the virtual bench"),
            tr("Each click gives the next view or press, as a technician would arrange it"),
        )
        self.lay.hide()
        self.live = named(PlainLabel(wrap=True), "calibrate.live", tr("Content of the live image"))
        self.live.setFixedHeight(HINT_LINES * self.live.fontMetrics().lineSpacing())
        self.live.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignBottom)
        self.progress = named(QProgressBar(), "calibrate.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        self.cancel = named(QToolButton(), "calibrate.stop", tr("Stop the work"))
        self.cancel.setText(tr("Stop"))
        for widget in (self.progress, self.cancel):
            widget.setFixedHeight(28)
            keep_space(widget)
        self.capture = named(
            QPushButton(tr("&Capture")), "calibrate.capture", tr("Capture"),
            tr("Capture this image"), "C",
        )  # fmt: skip
        self.more = named(
            QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup),
            "calibrate.more",
            tr("More about capturing"),
            tr("Import image files, or switch automatic captures"),
        )
        self.more.setText("…")
        menu = QMenu(self.more)
        self.import_files = make_action(
            menu, "calibrate.import", tr("&Import image files…"), lambda: None
        )
        self.automatic = QAction(tr("&Capture and continue automatically"), menu, checkable=True)
        self.automatic.setObjectName("calibrate.automatic")
        menu.addAction(self.automatic)
        self.more.setMenu(menu)
        self.capturing = QWidget()
        row = hbox((self.capture, 1), self.more, margins=0, spacing=8)
        vbox(self.lay, self.live, row, of=self.capturing, margins=0, spacing=8)
        self.next = named(QPushButton(tr("&Next step")), "calibrate.next", tr("Next step"))
        self.next.setProperty("primary", True)
        for button in (self.capture, self.next):
            button.setFixedHeight(36)
        self.more.setFixedSize(56, 36)
        foot = QWidget()
        self._foot = vbox(
            hbox((self.progress, 1), self.cancel, margins=0), self.capturing, self.next,
            of=foot, margins=(16, 8, 16, 16), spacing=8,
        )  # fmt: skip
        self.show_work("", 0.0)
        return foot

    def add_extra(self, text: str, field: QWidget) -> QFrame:
        """Add the card of a value that a step needs; the step shows and hides it."""
        caption = PlainLabel(text)
        show_meaning(caption, "muted")
        made = card(caption, field)
        self._extra.addWidget(made)
        QWidget.setTabOrder(self.lay, field)
        made.hide()
        return made

    # What is shown

    def add_foot(self, widget: QWidget) -> QWidget:
        """Add a step's own buttons above Next; the step shows and hides them."""
        self._foot.insertWidget(self._foot.count() - 1, widget)
        widget.hide()
        return widget

    def show_step(self, step: Step, *, following: str) -> None:
        """Show the task of another step; `following`: title of the next step, if any."""
        if step is not self.step:
            # The message belongs to the previous step; remove it, even during a computation.
            self._show_figures(())
            self.show_number(None, "")
            self.sentence.setText("")
            self.show_captures(())
        self.step, self._following = step, following
        self.finished = False
        self.title.setText(step.title)
        self.task.setText(step.task)
        self.help.show_step(step)
        self.capturing.setVisible(step.captures)
        self.capture.setText(step.button or tr("&Capture"))
        self.show_notice("", "pass")
        self.next.setVisible(bool(following))
        self.show_countdown(0)
        self._scroll.verticalScrollBar().setValue(0)

    def show_countdown(self, seconds: int) -> None:
        """Show on Next after how many seconds the next step opens by itself; 0: it does not."""
        text = tr("&Next: {title}").format(title=self._following)
        self.next.setText(f"{text}  ({seconds})" if seconds else text)

    def show_number(self, number: Finding | None, below: str, *, waits: bool = True) -> None:
        """Show the one figure of the step, and a line about its captures.

        `waits`: without a figure, there will be one; a step may also be complete without any.
        """
        text = (tr("No result yet") if waits else "") if number is None else number.text
        self.caption.setText(text)
        self.caption.setToolTip(plain_tip(text))
        self.number.setText("\u2013" if number is None else value_text(number))
        self.below.setText(below)

    def show_notice(self, sentence: str, role: str) -> None:
        """Show why the last capture, import or correction was not done; else an empty text."""
        self.notice.setText(sentence)
        self._notice_role = role
        self._show_message()
        if sentence:
            self.reveal_message()

    def reveal_message(self) -> None:
        """Scroll to what is wrong or comes next, once it has its place."""
        reveal = partial(self._scroll.ensureWidgetVisible, self._message)
        QTimer.singleShot(0, self, reveal)

    def show_running(self) -> None:
        """Show that the step is being computed; its figures stay until new ones arrive."""
        self._show_sign(RUNNING)
        self.sentence.setText("")
        self._remedies = {}
        self._show_message()

    def _show_sign(self, state: str) -> None:
        self._state = state
        self._sign.show_icon(state_icon(state))
        self._word.setText(state_word(state).capitalize())
        show_meaning(self._word, state_meaning(state))

    def show_live(self, sentence: str, *, ready: bool) -> None:
        """Show the detection message of the live image."""
        self.live.setText(sentence)
        show_meaning(self.live, "pass" if ready else "warn")

    def show_state(
        self,
        state: str,
        sentence: str,
        tables: Sequence[QualityTable],
        *,
        remedies: Sequence[Remedy] = (),
        finished: bool,
    ) -> None:
        """Show the state of the step.

        Parameters
        ----------
        state, sentence : str
            State of the step, and the message about it.
        tables : sequence of QualityTable
            Quality tables of its stages.
        remedies : sequence of (str, callable), optional
            What mends it, the best first.
        finished : bool
            Whether the step is complete.
        """
        self._show_sign(state)
        self.sentence.setText(sentence)
        self._show_figures(tables)
        self._remedies = dict(remedies)
        self.finished = finished
        self._show_message()

    def _show_message(self) -> None:
        """Show what is wrong: an action that was not done, or else the state of the step."""
        said = self.notice.text()
        wrong = self._state in ("warn", "fail", "stale", "waiting") and self.sentence.text()
        self.notice.setVisible(bool(said))
        self.sentence.setVisible(bool(wrong) and not said)
        texts = [] if said else list(self._remedies)[: len(self.buttons)]
        for place, button in enumerate(self.buttons):
            button.setVisible(place < len(texts))
            button.setText(texts[place] if place < len(texts) else "")
        role = self._notice_role if said else self._state
        show_ground(self._message, role if role in ("warn", "fail") else "")
        self._message.setVisible(bool(said or wrong or texts))

    _state, _notice_role = "empty", "pass"

    def _show_figures(self, tables: Sequence[QualityTable]) -> None:
        figures = tuple(figure for table in tables for figure in table.figures)
        self.quality.set_table(QualityTable(figures))
        self.quality.setVisible(bool(figures))

    def show_captures(self, captures: Sequence[Capture]) -> None:
        """Show the captures that have a residual, the worst first."""
        judged = {c.path: c.finding for c in captures if c.finding and isfinite(c.residual)}
        worst = sorted(judged.items(), key=lambda one: one[1].value, reverse=True)
        self.worst = worst[0][0].name if worst else ""
        self.residual.setText(worst[0][1].text if worst else "")
        self.residuals.set_table(
            QualityTable(tuple(replace(found, text=path.stem) for path, found in worst))
        )
        for widget in (self.residual, self.residuals, self.repeat):
            widget.setVisible(len(worst) >= LEAST_CAPTURES)

    def show_work(self, title: str, share: float) -> None:
        """Show the running work; an empty title means none."""
        self.progress.setVisible(bool(title))
        self.cancel.setVisible(bool(title))
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setRange(0, 100 if share > 0.0 else 0)
        self.progress.setValue(round(100 * share))


def card(*parts: object) -> QFrame:
    """Return a card with parts from top to bottom."""
    frame = QFrame()
    frame.setObjectName("card")
    vbox(*parts, of=frame, margins=(12, 8, 12, 8), spacing=4)
    return frame


def _message() -> PlainLabel:
    label = PlainLabel(wrap=True)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label
