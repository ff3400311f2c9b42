"""Panel next to the live image: the next press, its state, and the progress of the run."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QHeaderView,
    QProgressBar,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.measure.placing import kind_label
from app.measure.press_check import object_name
from app.theme import theme
from app.widgets.buttons import Slot, push_button
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.protocol import SAME_REGION
from gelpolight_core.measurement.protocol_run import RunProgress
from gelpolight_core.measurement.result import Measurement, compare
from gelpolight_core.translation import tr

WIDTH = 372
LIVE_LINES = 3
DOUBTFUL = Qt.ItemDataRole.UserRole
MOST_ROWS = 200


class RunPanel(QWidget):
    """Shows the next press and the last ones.

    Parameters
    ----------
    on_bare, on_capture, on_take_back, on_leave, on_evaluate : callable
        Called by the buttons.
    """

    def __init__(
        self,
        *,
        on_bare: Slot,
        on_capture: Slot,
        on_take_back: Slot,
        on_leave: Slot,
        on_evaluate: Slot,
    ) -> None:
        super().__init__()
        named(self, "protocol.panel", tr("Next press"))
        self.setFixedWidth(WIDTH)
        self.title = named(PlainLabel(wrap=True), "protocol.title", tr("Next object"))
        make_bold(self.title, size=1.35)
        self.where = named(PlainLabel(wrap=True), "protocol.where", tr("Position"))
        self.live = named(PlainLabel(wrap=True), "protocol.live", tr("State of the live image"))
        font = self.live.font()
        font.setPixelSize(15)
        self.live.setFont(font)
        # Reserved space, so that nothing below moves when a text changes.
        self.live.setMinimumHeight(LIVE_LINES * self.live.fontMetrics().lineSpacing() + 12)
        self.where.setMinimumHeight(2 * self.where.fontMetrics().lineSpacing() + 2)
        for label in (self.where, self.live):
            label.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.bare = push_button(
            "protocol.bare",
            tr("Capture &bare membrane"),
            on_bare,
            accessible=tr("Capture the bare membrane and start"),
        )
        self.bare.setMinimumHeight(38)
        self.capture = push_button(
            "protocol.capture",
            tr("&Capture now"),
            on_capture,
            accessible=tr("Capture this press now"),
            tip=tr("A steady press is captured automatically. A press that moves is refused"),
        )
        self.take_back = push_button(
            "protocol.take_back",
            tr("&Repeat last press"),
            on_take_back,
            tip=tr('The old image is moved to the folder "discarded"'),
        )
        self.bench = named(
            QCheckBox(tr("&Use virtual bench")),
            "protocol.bench",
            tr("Let the virtual bench make the presses"),
        )
        self.progress = named(QProgressBar(), "protocol.progress", tr("Progress of the run"))
        self.progress.setTextVisible(False)
        self.counts = named(
            PlainLabel(wrap=True), "protocol.counts", tr("Presses done, refused and measured")
        )
        self.last = self._make_table()
        self.leave = push_button(
            "protocol.leave",
            tr("Lea&ve"),
            on_leave,
            accessible=tr("Leave the run"),
            tip=tr("Every press is saved. You can continue here later"),
        )
        self.evaluate = push_button(
            "protocol.evaluate",
            tr("Show the &result"),
            on_evaluate,
            accessible=tr("Evaluate the presses so far"),
        )
        vbox(
            self.title,
            self.where,
            self.live,
            self.bare,
            hbox(self.capture, self.take_back),
            self.bench,
            self.progress,
            self.counts,
            (self.last, 1),
            hbox(self.leave, (self.evaluate, 1)),
            of=self,
            margins=(12, 10, 12, 10),
            spacing=8,
        )

    @staticmethod
    def _make_table() -> QTableWidget:
        table = named(QTableWidget(0, 3), "protocol.last", tr("Presses measured, newest first"))
        table.setHorizontalHeaderLabels([tr("Press"), tr("Size"), tr("Height")])
        table.verticalHeader().hide()
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        table.setShowGrid(False)
        table.setTabKeyNavigation(False)
        header = table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        return table

    def show_press(self, press: Press | None, repeats: int) -> None:
        """Show the next press. None: all are done."""
        if press is None:
            self.title.setText(tr("All presses are done"))
            self.where.setText(tr("Show the result."))
            return
        self.title.setText(object_name(press.truth))
        region = region_name(press)
        if press.region == SAME_REGION:
            region = tr("{region}, press {n} of {all}").format(
                region=region, n=press.repeat, all=repeats
            )
        x, y = press.position_mm
        text = tr("{region}: at ({x:.1f}, {y:.1f}) mm").format(region=region, x=x, y=y)
        if press.truth.shape == "cuboid":
            text += tr(", rotated as drawn")
        self.where.setText(text + ".")

    def show_live(self, sentence: str, *, good: bool = False) -> None:
        """Show the state of the live image."""
        self.live.setText(sentence)
        show_meaning(self.live, "pass" if good else "")

    def show_progress(self, progress: RunProgress, measured: int) -> None:
        """Show the progress of the run."""
        self.progress.setRange(0, progress.total)
        self.progress.setValue(progress.done)
        text = tr("{done} of {total} presses, {measured} measured").format(
            done=progress.done, total=progress.total, measured=measured
        )
        if progress.refused:
            text += tr(", {n} refused").format(n=progress.refused)
        if progress.object_total:
            text += tr("\nThis object: {done} of {total}").format(
                done=progress.object_done, total=progress.object_total
            )
        else:
            text += "\n"
        self.counts.setText(text)
        self.take_back.setEnabled(progress.done > 0)
        self.evaluate.setEnabled(progress.done > 0)

    def show_measured(self, press: Press, outcome: Measurement | str) -> None:
        """Add a measured press to the top of the list."""
        texts = [_press_name(press), tr("not measured"), ""]
        tip = outcome if isinstance(outcome, str) else outcome.reason
        if not isinstance(outcome, str):
            texts[1:] = (f"{q.error_percent:+.1f} %" for q in compare(outcome, press.truth))
        self.last.insertRow(0)
        for column, text in enumerate(texts):
            item = QTableWidgetItem(text)
            item.setToolTip(plain_tip(tip or texts[0]))
            if column:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            if isinstance(outcome, str) or outcome.reason:
                item.setData(DOUBTFUL, True)
                item.setForeground(theme.colour("warn"))
            self.last.setItem(0, column, item)
        self.last.setRowCount(min(self.last.rowCount(), MOST_ROWS))

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "last"):
            for item in self.last.findItems("", Qt.MatchFlag.MatchContains):
                if item.data(DOUBTFUL):
                    item.setForeground(theme.colour("warn"))


def region_name(press: Press) -> str:
    """Return the name of a press's region for the user."""
    if press.region == SAME_REGION:
        return tr("Same region")
    return tr("Random region {n}").format(n=press.region.removeprefix("r").lstrip("0"))


def _press_name(press: Press) -> str:
    truth = press.truth
    return tr("{shape} {size:g} x {height:g}, {region}").format(
        shape=kind_label(truth.shape),
        size=truth.size_mm,
        height=truth.height_mm,
        region=region_name(press).lower(),
    )
