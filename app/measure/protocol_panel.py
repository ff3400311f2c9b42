"""Panel next to the live image: the next press, its state, and the progress of the run."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QHeaderView,
    QProgressBar,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.measure.press_check import object_name
from app.theme import theme
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.protocol import SAME_REGION, PressWanted
from gelpolight_core.measurement.protocol_run import RunProgress
from gelpolight_core.measurement.result import Measurement, compare
from gelpolight_core.translation import tr

WIDTH = 372
LIVE_LINES = 3
DOUBTFUL = Qt.ItemDataRole.UserRole
MOST_ROWS = 200


class RunPanel(QWidget):
    """Shows the next press and the last ones.

    Signals
    -------
    bare_wanted()
        The membrane is bare: capture it.
    capture_wanted()
        Capture this press now, steady or not.
    take_back_wanted()
        Repeat the last press.
    bench_wanted(bool)
        Start or stop presses by the virtual bench.
    evaluate_wanted()
        Show the result of the presses so far.
    leave_wanted()
        Leave the run. It can be continued later.
    """

    bare_wanted = Signal()
    capture_wanted = Signal()
    take_back_wanted = Signal()
    bench_wanted = Signal(bool)
    evaluate_wanted = Signal()
    leave_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "protocol.panel", tr("Next press"))
        self.setFixedWidth(WIDTH)
        column = vbox(of=self, margins=(12, 10, 12, 10), spacing=8)
        self._build_task(column)
        self._build_buttons(column)
        self._build_progress(column)
        self._build_last(column)
        self._build_foot(column)

    def _build_task(self, column: QVBoxLayout) -> None:
        self.title = named(PlainLabel(), "protocol.title", tr("Next object"))
        make_bold(self.title, size=1.35)
        self.title.setWordWrap(True)
        self.where = named(PlainLabel(), "protocol.where", tr("Position"))
        self.where.setWordWrap(True)
        self.live = named(PlainLabel(), "protocol.live", tr("State of the live image"))
        font = self.live.font()
        font.setPixelSize(15)
        self.live.setFont(font)
        self.live.setWordWrap(True)
        self.live.setAlignment(Qt.AlignmentFlag.AlignTop)
        # Reserved space, so that nothing below moves when a text changes.
        self.live.setMinimumHeight(LIVE_LINES * self.live.fontMetrics().lineSpacing() + 12)
        self.where.setMinimumHeight(2 * self.where.fontMetrics().lineSpacing() + 2)
        self.where.setAlignment(Qt.AlignmentFlag.AlignTop)
        for label in (self.title, self.where, self.live):
            column.addWidget(label)

    def _build_buttons(self, column: QVBoxLayout) -> None:
        self.bare = named(
            QPushButton(tr("Capture &bare membrane")),
            "protocol.bare",
            tr("Capture the bare membrane and start"),
        )
        self.bare.setMinimumHeight(38)
        self.bare.clicked.connect(self.bare_wanted)
        self.capture = named(
            QPushButton(tr("&Capture now")),
            "protocol.capture",
            tr("Capture this press now"),
            tr("A steady press is captured automatically. A press that moves is refused"),
        )
        self.capture.clicked.connect(self.capture_wanted)
        self.take_back = named(
            QPushButton(tr("&Repeat last press")),
            "protocol.take_back",
            tr("Repeat the last press"),
            tr('The old image is moved to the folder "discarded"'),
        )
        self.take_back.clicked.connect(self.take_back_wanted)
        self.bench = named(
            QCheckBox(tr("&Use virtual bench")),
            "protocol.bench",
            tr("Let the virtual bench make the presses"),
        )
        self.bench.toggled.connect(self.bench_wanted)
        column.addWidget(self.bare)
        row = hbox(self.capture, self.take_back)
        column.addLayout(row)
        column.addWidget(self.bench)

    def _build_progress(self, column: QVBoxLayout) -> None:
        self.progress = named(QProgressBar(), "protocol.progress", tr("Progress of the run"))
        self.progress.setTextVisible(False)
        self.counts = named(
            PlainLabel(), "protocol.counts", tr("Presses done, refused and measured")
        )
        self.counts.setWordWrap(True)
        column.addWidget(self.progress)
        column.addWidget(self.counts)

    def _build_last(self, column: QVBoxLayout) -> None:
        self.last = named(QTableWidget(0, 3), "protocol.last", tr("Presses measured, newest first"))
        self.last.setHorizontalHeaderLabels([tr("Press"), tr("Size"), tr("Height")])
        self.last.verticalHeader().hide()
        self.last.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.last.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.last.setShowGrid(False)
        self.last.setTabKeyNavigation(False)
        header = self.last.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        column.addWidget(self.last, 1)

    def _build_foot(self, column: QVBoxLayout) -> None:
        self.leave = named(
            QPushButton(tr("Lea&ve")),
            "protocol.leave",
            tr("Leave the run"),
            tr("Every press is saved. You can continue here later"),
        )
        self.leave.clicked.connect(self.leave_wanted)
        self.evaluate = named(
            QPushButton(tr("Show the &result")),
            "protocol.evaluate",
            tr("Evaluate the presses so far"),
        )
        self.evaluate.clicked.connect(self.evaluate_wanted)
        row = hbox(self.leave, (self.evaluate, 1))
        column.addLayout(row)

    def show_press(self, press: PressWanted | None, repeats: int) -> None:
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

    def show_measured(self, press: PressWanted, outcome: Measurement | str) -> None:
        """Add a measured press to the top of the list."""
        texts = [_press_name(press), tr("not measured"), ""]
        tip = outcome if isinstance(outcome, str) else outcome.reason
        if not isinstance(outcome, str):
            found = compare(outcome, press.truth)
            texts[1] = f"{found.size_error_percent:+.1f} %"
            texts[2] = f"{found.height_error_percent:+.1f} %"
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
            for row in range(self.last.rowCount()):
                for column in range(self.last.columnCount()):
                    item = self.last.item(row, column)
                    if item is not None and item.data(DOUBTFUL):
                        item.setForeground(theme.colour("warn"))


def region_name(press: PressWanted) -> str:
    """Return the name of a press's region for the user."""
    if press.region == SAME_REGION:
        return tr("Same region")
    return tr("Random region {n}").format(n=press.region.removeprefix("r").lstrip("0"))


def _press_name(press: PressWanted) -> str:
    truth = press.truth
    shape = {"cylinder": tr("Cylinder"), "cuboid": tr("Cuboid")}[truth.shape]
    return tr("{shape} {size:g} x {height:g}, {region}").format(
        shape=shape, size=truth.size_mm, height=truth.height_mm, region=region_name(press).lower()
    )
