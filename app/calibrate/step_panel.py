"""The side panel of a step: its task, its state, and its buttons."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QScrollBar,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.assembly import AssemblyDrawing
from app.calibrate.residual_table import ResidualTable
from app.calibrate.states import RUNNING, state_icon, state_meaning, state_word
from app.calibrate.step_data import Step
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, keep_space, scroll_area, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from app.widgets.sign import Sign
from gelpolight_core.finding import QualityTable
from gelpolight_core.translation import tr

WIDTH = 372
# This space is always reserved, so that nothing below moves when a message changes.
LIVE_LINES = 4


class StepPanel(QWidget):
    """The side panel of a step with images; its lower part is always visible.

    Attributes
    ----------
    finished : bool
        Whether the step is complete.

    """

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.panel", tr("This step"))
        self.setFixedWidth(WIDTH)
        self.finished = False
        self._step: Step | None = None
        self._scroll, inside = side_scroll("calibrate.panel.scroll", tr("This step"))
        self._column = vbox(of=inside, margins=(12, 10, 12, 6), spacing=8)
        self._build_head()
        self._build_capture()
        self._build_state()
        self._column.addStretch(1)
        vbox((self._scroll, 1), self._build_foot(), of=self, margins=0, spacing=0)

    def _build_head(self) -> None:
        self.title = named(PlainLabel(), "calibrate.title", tr("Step"))
        make_bold(self.title, size=1.35)
        self.task = named(_wrapped(), "calibrate.task", tr("Task"))
        self.assembly = AssemblyDrawing()
        self.help = help_button("calibrate.help")
        head = hbox((self.title, 1), self.help)
        self._column.addLayout(head)
        for widget in (self.assembly, self.task):
            self._column.addWidget(widget)

    def _build_capture(self) -> None:
        self.live = named(
            _wrapped(lines=LIVE_LINES), "calibrate.live", tr("Content of the live image")
        )
        self.live.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.capture = named(
            QPushButton(tr("&Capture"), minimumHeight=38),
            "calibrate.capture",
            tr("Capture"),
            tr("Capture this image"),
            "C",
        )
        self.automatic = named(
            QCheckBox(tr("&Automatic: capture and continue")),
            "calibrate.automatic",
            tr(
                "Capture automatically when the image is still and good, and continue when complete"
            ),
            tr("Hands-free: after each capture it waits until you have moved something"),
        )
        self.import_files = named(
            QPushButton(tr("&Import…")), "calibrate.import", tr("Import image files")
        )
        buttons = hbox((self.capture, 2), (self.import_files, 1))
        self.capturing = QWidget()
        self.lay = lay_button("calibrate.lay")
        self._extra = QVBoxLayout()
        self.notice = named(_wrapped(lines=2), "calibrate.notice", tr("Result of the last action"))
        self.notice.setAlignment(Qt.AlignmentFlag.AlignTop)
        vbox(
            self.lay,
            self.live,
            self._extra,
            buttons,
            self.automatic,
            self.notice,
            of=self.capturing,
            margins=0,
        )
        self._column.addWidget(self.capturing)

    def _build_state(self) -> None:
        self._sign = Sign()
        self._word = named(PlainLabel(), "calibrate.state", tr("State of the step"))
        make_bold(self._word)
        self.recompute = named(
            QPushButton(tr("&Recompute")),
            "calibrate.recompute",
            tr("Recompute"),
            tr("Compute this step again from the stored captures"),
        )
        row = hbox(self._sign, (self._word, 1), self.recompute)
        self.sentence = named(_wrapped(), "calibrate.sentence", tr("Message about the step"))
        self.quality = QualityTableWidget(
            "calibrate.quality", tr("Quality figures of this step"), narrow=True
        )
        self._column.addLayout(row)
        self._column.addWidget(self.sentence)
        self._column.addWidget(self.quality)
        self.residuals = ResidualTable()
        self._column.addWidget(self.residuals)

    def _build_foot(self) -> QVBoxLayout:
        self.progress = named(QProgressBar(), "calibrate.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        self.progress.setTextVisible(True)
        self.cancel = named(QPushButton(tr("Stop")), "calibrate.stop", tr("Stop the work"))
        for widget in (self.progress, self.cancel):
            keep_space(widget)
        row = hbox((self.progress, 1), self.cancel)
        self.next = named(QPushButton(tr("&Next step")), "calibrate.next", tr("Next step"))
        self.next.setMinimumHeight(38)
        foot = vbox(row, self.next, margins=(12, 4, 12, 10), spacing=6)
        self.show_work("", 0.0)
        return foot

    def add_extra(self, widget: QWidget, focus: QWidget) -> None:
        """Add a step's own input above the buttons; the step shows and hides it."""
        self._extra.addWidget(widget)
        QWidget.setTabOrder(self.lay, focus)
        widget.hide()

    def show_step(self, step: Step, *, following: str) -> None:
        """Show the task of another step; `following`: title of the next step, if any."""
        if step is not self._step:
            # The message belongs to the previous step; remove it, even during a computation.
            self._show_figures(())
            self.residuals.show_captures((), shown="")
        self._step = step
        self._show_finished(False)
        self.title.setText(step.title)
        self.task.setText(step.task)
        self.assembly.show_assembly(step.assembly)
        self.capturing.setVisible(step.captures)
        self.show_notice("", "pass")
        self.next.setVisible(bool(following))
        self.next.setText(tr("&Next: {title}").format(title=following))
        self._scroll.verticalScrollBar().setValue(0)

    def show_count(self, count: int) -> None:
        """Show on the Capture button how many images there are, and how many are recommended."""
        wanted = 1 if self._step is None else self._step.wanted
        text = tr("&Capture")
        if wanted > 1:
            text = tr("&Capture  ({n} of {m})").format(n=count, m=max(wanted, count))
        elif count:
            alone = self._step is not None and self._step.one_image
            text = tr("&Capture again") if alone else tr("&Capture another")
        self.capture.setText(text)

    def show_notice(self, sentence: str, role: str) -> None:
        """Show the result of the last capture, import or correction."""
        self.notice.setText(sentence)
        show_meaning(self.notice, role)

    def show_running(self) -> None:
        """Show that the step is being computed; its figures stay until new ones arrive."""
        self._show_sign(RUNNING)
        self.sentence.setText(tr("Computing from the captures."))
        self.recompute.hide()

    def _show_sign(self, state: str) -> None:
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
        recompute: bool,
        finished: bool,
    ) -> None:
        """Show the state of the step.

        Parameters
        ----------
        state, sentence : str
            State of the step, and the message about it.
        tables : sequence of QualityTable
            Quality tables of its stages.
        recompute : bool
            Whether to offer Recompute.
        finished : bool
            Whether the step is complete, so that Next becomes the main button.
        """
        self._show_sign(state)
        if recompute:
            sentence = tr("{sentence}. Click Recompute.").format(sentence=sentence.rstrip("."))
        self.sentence.setText(sentence)
        self._show_figures(tables)
        self.recompute.setVisible(recompute)
        self._show_finished(finished)

    def _show_figures(self, tables: Sequence[QualityTable]) -> None:
        figures = tuple(figure for table in tables for figure in table.figures)
        self.quality.set_table(QualityTable(figures))
        self.quality.setVisible(bool(figures))

    def _show_finished(self, finished: bool) -> None:
        self.finished = finished
        self.next.setStyleSheet("font-weight: bold;" if finished else "")

    def show_work(self, title: str, share: float) -> None:
        """Show the running work; an empty title means none."""
        self.progress.setVisible(bool(title))
        self.cancel.setVisible(bool(title))
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setRange(0, 100 if share > 0.0 else 0)
        self.progress.setValue(round(100 * share))


class _QuietBar(QScrollBar):
    """A scroll bar that is invisible if there is nothing to scroll, but keeps its space.

    The widgets next to it do not move when it appears.
    """

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the bar, or nothing if there is nothing to scroll."""
        if self.maximum() > self.minimum():
            super().paintEvent(event)


def side_scroll(name: str, accessible: str) -> tuple[QScrollArea, QWidget]:
    """Return a vertical scroll area for a side panel, and the widget in it."""
    inside = QWidget()
    scroll = named(scroll_area(inside), name, accessible)
    scroll.setVerticalScrollBar(_QuietBar())
    scroll.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
    scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return scroll, inside


def lay_button(name: str) -> QPushButton:
    """Return the button of the virtual bench; hidden with a real camera."""
    button = named(
        QPushButton(tr("Place it on the virtual &bench")),
        name,
        tr("Place the object for this step on the virtual bench"),
        tr("Each click gives the next view or press, as a technician would arrange it"),
    )
    button.hide()
    return button


def _wrapped(*, lines: int = 0) -> PlainLabel:
    label = PlainLabel(wrap=True)
    label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    if lines:
        label.setMinimumHeight(lines * label.fontMetrics().lineSpacing() + 4)
    return label


def help_button(name: str) -> QToolButton:
    """Return the button that opens the guide at a step."""
    button = named(QToolButton(), name, tr("Help on this step"), tr("Read about this step"))
    button.setText("?")
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return button
