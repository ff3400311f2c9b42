"""A stage's quality figures: verdict, value, limit, and advice for those that do not pass."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QRect, QSize, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QKeySequence, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QSizePolicy,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.theme import theme
from app.theme.icons import icon
from app.widgets.actions import make_action
from app.widgets.label import plain_tip
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.quality import (
    Figure,
    QualityTable,
    Verdict,
    limit_text,
    value_text,
    verdict_word,
)
from gelpolight_core.translation import tr

VERDICT_COLUMN, LABEL_COLUMN, VALUE_COLUMN, LIMIT_COLUMN = range(4)
COLUMNS = 4
ROW_HEIGHT = 24
MARGIN = 6


class _Grid(QTableWidget):
    """A table whose copy shortcut copies whole rows instead of a single cell."""

    copy_asked = Signal()
    resized = Signal()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Announce the new width once the columns have it."""
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self.resized.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Copy the rows, or handle the key as usual."""
        if event.matches(QKeySequence.StandardKey.Copy):
            self.copy_asked.emit()
        else:
            super().keyPressEvent(event)


class QualityTableWidget(QWidget):
    """Shows a QualityTable without scrolling. Rows are updated in place.

    Parameters
    ----------
    name : str
        Object name, a dotted path.
    accessible : str
        Text for screen readers, such as "Quality of the lens".
    narrow : bool, optional
        For a side panel: verdicts as icons without text, long labels wrapped.
    """

    def __init__(
        self, name: str, accessible: str, parent: QWidget | None = None, *, narrow: bool = False
    ) -> None:
        super().__init__(parent)
        named(self, name, accessible)
        self._narrow = narrow
        self._shown: tuple[tuple[str, bool], ...] = ()
        self._table = QualityTable()
        self._grid = named(_Grid(0, COLUMNS, self), f"{name}.table", accessible)
        # The columns verdict, figure, value and limit need no header.
        self._grid.horizontalHeader().hide()
        self._grid.verticalHeader().hide()
        self._grid.setShowGrid(False)
        self._grid.setWordWrap(True)
        self._grid.setFrameShape(QTableWidget.Shape.NoFrame)
        self._grid.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self._grid.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self._grid.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._grid.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._grid.setTabKeyNavigation(False)
        header = self._grid.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(LABEL_COLUMN, QHeaderView.ResizeMode.Stretch)
        header.setMinimumSectionSize(28 if narrow else 80)
        header.sectionResized.connect(self._fit)
        self._grid.verticalHeader().setMinimumSectionSize(1)
        make_action(self._grid, f"{name}.copy", tr("&Copy"), self.copy, icon_name="copy")
        self._grid.copy_asked.connect(self.copy)
        self._grid.resized.connect(self._fit)
        self._grid.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        vbox(self._grid, of=self, margins=0)

    def set_table(self, table: QualityTable) -> None:
        """Show a table. The same figures keep their rows and the selection."""
        self._table = table
        wanted = tuple((f.key, _has_advice(f)) for f in table.figures)
        if wanted != self._shown:
            self._shown = wanted
            self._grid.clearSpans()
            self._grid.clearContents()
            self._grid.setRowCount(sum(1 + advice for _, advice in wanted))
        row = 0
        for figure in table.figures:
            self._show_figure(row, figure)
            row += 1
            if _has_advice(figure):
                self._show_advice(row, figure)
                row += 1
        self._fit()

    def texts(self) -> list[list[str]]:
        """Return the text of the rows, for copies and tests."""
        return [self._row_texts(row) for row in range(self._grid.rowCount())]

    def copy(self) -> None:
        """Copy the selected rows, or all rows, to the clipboard."""
        chosen = sorted({index.row() for index in self._grid.selectedIndexes()})
        rows = chosen or range(self._grid.rowCount())
        text = "\n".join("\t".join(self._row_texts(row)).rstrip() for row in rows)
        QGuiApplication.clipboard().setText(text)

    def _row_texts(self, row: int) -> list[str]:
        items = [self._grid.item(row, column) for column in range(COLUMNS)]
        return ["" if item is None else item.text() for item in items]

    def _show_figure(self, row: int, figure: Figure) -> None:
        verdict = self._item(row, VERDICT_COLUMN)
        word = verdict_word(figure.verdict)
        verdict.setText("" if self._narrow else word)
        verdict.setToolTip(plain_tip(word))
        verdict.setData(Qt.ItemDataRole.AccessibleTextRole, word)
        verdict.setIcon(icon(figure.verdict.value, figure.verdict.value))
        verdict.setForeground(theme.colour(figure.verdict.value))
        label = self._item(row, LABEL_COLUMN)
        label.setText(figure.label)
        label.setToolTip(plain_tip(figure.label))
        for column, text in (
            (VALUE_COLUMN, value_text(figure)),
            (LIMIT_COLUMN, limit_text(figure)),
        ):
            item = self._item(row, column)
            item.setText(text)
            item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self._grid.item(row, LIMIT_COLUMN).setForeground(theme.colour("muted"))

    def _show_advice(self, row: int, figure: Figure) -> None:
        self._item(row, VERDICT_COLUMN).setText("")
        self._item(row, LABEL_COLUMN).setText(f"{figure.advice}.")
        if self._grid.columnSpan(row, LABEL_COLUMN) == 1:
            self._grid.setSpan(row, LABEL_COLUMN, 1, COLUMNS - LABEL_COLUMN)

    def _item(self, row: int, column: int) -> QTableWidgetItem:
        item = self._grid.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            self._grid.setItem(row, column, item)
        return item

    def _fit(self, *_: int) -> None:
        """Wrap the advice to the width, and set the height to that of all rows."""
        columns = range(LABEL_COLUMN, COLUMNS)
        whole = sum(self._grid.columnWidth(column) for column in columns) - 2 * MARGIN
        metrics = self._grid.fontMetrics()
        wrap = int(Qt.TextFlag.TextWordWrap)
        line = max(ROW_HEIGHT, metrics.height() + MARGIN)
        for row in range(self._grid.rowCount()):
            item = self._grid.item(row, LABEL_COLUMN)
            height = line
            spans = self._grid.columnSpan(row, LABEL_COLUMN) > 1
            if item is not None and (spans or self._narrow):
                label = self._grid.columnWidth(LABEL_COLUMN) - 2 * MARGIN
                width = whole if spans else label
                area = QRect(0, 0, max(width, 50), 10_000)
                height = metrics.boundingRect(area, wrap, item.text()).height() + MARGIN
                height = height if spans else max(line, height)
            self._grid.setRowHeight(row, height)
        self._grid.setFixedHeight(self._grid.verticalHeader().length())

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_grid"):
            self.set_table(self._table)

    def minimumSizeHint(self) -> QSize:
        """Return a width at which the label is readable."""
        return QSize(260 if self._narrow else 360, super().minimumSizeHint().height())


def _has_advice(figure: Figure) -> bool:
    return figure.verdict is not Verdict.PASS and bool(figure.advice)
