"""The captures of a step with their residuals, worst first."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRectF, Qt, Signal
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QPushButton,
    QSizePolicy,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.calibrate.film_strip import Capture
from app.calibrate.states import state_icon, state_word
from app.theme import theme
from app.widgets.label import plain_tip
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

NAME_COLUMN, RESIDUAL_COLUMN = range(2)
SHARE = Qt.ItemDataRole.UserRole + 1
ROW_HEIGHT = 22
LEAST_CAPTURES = 2
"""With fewer captures there is nothing to compare."""


class ResidualTable(QWidget):
    """Shows how well each capture fits the result, and offers to repeat the worst.

    Signals
    -------
    chosen(str)
        Name of the image to show.
    repeat_wanted(str)
        Name of the image to capture again: the worst one.
    """

    chosen = Signal(str)
    repeat_wanted = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.residuals", tr("Residuals of the captures"))
        self._captures: tuple[Capture, ...] = ()
        self._table = named(
            QTableWidget(0, 2), "calibrate.residuals.table", tr("Captures, worst first")
        )
        self._table.verticalHeader().hide()
        self._table.verticalHeader().setDefaultSectionSize(ROW_HEIGHT)
        self._table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self._table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self._table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self._table.setTabKeyNavigation(False)
        self._table.setShowGrid(False)
        self._table.setItemDelegateForColumn(RESIDUAL_COLUMN, _Bars(self._table))
        header = self._table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        header.setHighlightSections(False)
        self._table.itemClicked.connect(self._choose)
        self._table.itemActivated.connect(self._choose)
        self.repeat = named(
            QPushButton(tr("Repeat the &worst")),
            "calibrate.residuals.repeat",
            tr("Repeat the worst capture"),
            tr("Exclude the capture with the largest residual, and capture a new one"),
        )
        self.repeat.clicked.connect(lambda: self.repeat_wanted.emit(self.worst))
        vbox(self._table, self.repeat, of=self, margins=0)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.hide()

    @property
    def worst(self) -> str:
        """Name of the capture with the largest residual."""
        return self._captures[0].path.name

    def show_captures(self, captures: Sequence[Capture], *, shown: str) -> None:
        """Show the captures that have a residual.

        Parameters
        ----------
        captures : sequence of Capture
            All captures of the step.
        shown : str
            Name of the shown capture, which is selected; empty for the live image.
        """
        judged = [capture for capture in captures if math.isfinite(capture.residual)]
        self._captures = tuple(sorted(judged, key=lambda c: c.residual, reverse=True))
        there = len(judged) >= LEAST_CAPTURES
        self.setVisible(there)
        if not there:
            return
        finding = self._captures[0].finding
        assert finding is not None
        self._table.setHorizontalHeaderLabels([tr("Capture"), f"{finding.text}, {finding.unit}"])
        self._table.setRowCount(len(self._captures))
        largest = max(self._captures[0].residual, 1e-12)
        for row, capture in enumerate(self._captures):
            name = QTableWidgetItem(state_icon(capture.state), capture.path.stem)
            name.setData(
                Qt.ItemDataRole.AccessibleTextRole,
                f"{capture.path.stem}, {state_word(capture.state)}",
            )
            value = QTableWidgetItem(f"{capture.residual:.3g}")
            value.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            value.setData(SHARE, capture.residual / largest)
            tip = "" if capture.finding is None else capture.finding.sentence
            for column, item in ((NAME_COLUMN, name), (RESIDUAL_COLUMN, value)):
                item.setToolTip(plain_tip(tip))
                self._table.setItem(row, column, item)
        self.select(shown)
        rows = min(len(self._captures), 6)
        head = self._table.horizontalHeader().sizeHint().height()
        self._table.setFixedHeight(head + rows * ROW_HEIGHT + 2 * self._table.frameWidth())

    def select(self, name: str) -> None:
        """Select a capture by its name; nothing for a name that is not in the table."""
        names = [capture.path.name for capture in self._captures]
        if name in names:
            self._table.selectRow(names.index(name))
        else:
            self._table.clearSelection()

    def texts(self) -> list[tuple[str, ...]]:
        """Return capture and residual of each row, as shown."""
        rows, model = 0 if self.isHidden() else self._table.rowCount(), self._table.model()
        columns = (NAME_COLUMN, RESIDUAL_COLUMN)
        return [tuple(model.index(row, k).data() for k in columns) for row in range(rows)]

    def _choose(self, item: QTableWidgetItem) -> None:
        self.chosen.emit(self._captures[item.row()].path.name)


class _Bars(QStyledItemDelegate):
    """Draws a bar behind a value, as long as its share of the largest."""

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw the bar, then the value."""
        area = QRectF(option.rect).adjusted(1.0, 4.0, -1.0, -4.0)
        area.setWidth(area.width() * float(index.data(SHARE) or 0.0))
        colour = theme.colour("accent")
        colour.setAlphaF(0.25)
        painter.fillRect(area, colour)
        super().paint(painter, option, index)
