"""Find controls of a window that cannot be reached or read: hidden, cut or covered by nothing."""

from collections.abc import Iterator

from pyqtgraph import PlotWidget
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QAbstractSpinBox,
    QComboBox,
    QDockWidget,
    QLabel,
    QLineEdit,
    QScrollArea,
    QTableView,
    QToolBar,
    QToolButton,
    QWidget,
)
from qt_tree import find_children

CONTROLS = (QAbstractButton, QComboBox, QLineEdit, QAbstractSpinBox, QLabel)
EXTENSION = "qt_toolbar_ext_button"
SLACK_PX = 2
LEAST_PLOT_PX = 80
"""Curves in a narrower plot cannot be distinguished."""


def faults(window: QWidget) -> list[str]:
    """Return a line for each control of a window that is cut or cannot be reached."""
    found = []
    for widget in find_children(window, QWidget):
        if not widget.isVisible() or widget.window() is not window or _behind_a_tab(widget):
            continue
        if isinstance(widget, QToolBar):
            found += _lost_actions(widget)
        elif isinstance(widget, QTableView):
            found += _cut_columns(widget)
        elif isinstance(widget, QScrollArea):
            found += _scrolled_sideways(widget)
        elif isinstance(widget, PlotWidget):
            found += _narrow_plot(widget)
        elif isinstance(widget, CONTROLS):
            found += _cut(widget)
    return list(dict.fromkeys(found))


def _behind_a_tab(widget: QWidget) -> bool:
    """Whether a widget is in a dock that another one covers. Its tab brings it to the front."""
    ancestor = widget.parentWidget()
    while ancestor is not None and not isinstance(ancestor, QDockWidget):
        ancestor = ancestor.parentWidget()
    return ancestor is not None and ancestor.visibleRegion().isEmpty()


def name_of(widget: QWidget) -> str:
    """Return the names of a widget and of its nearest named ancestor."""
    ancestor = widget
    while ancestor is not None and not ancestor.objectName():
        ancestor = ancestor.parentWidget()
    inner = "" if ancestor is widget else f" > {type(widget).__name__}"
    text = getattr(widget, "text", lambda: "")()
    return f"{ancestor.objectName() if ancestor else '?'}{inner} {text[:40]!r}"


def _cut(widget: QWidget) -> Iterator[str]:
    needed = widget.minimumSizeHint()
    if isinstance(widget, QLabel) and widget.wordWrap():
        wanted = widget.heightForWidth(widget.width())
        if widget.text() and wanted > widget.height() + SLACK_PX:
            yield f"{name_of(widget)}: {widget.height()} px high, needs {wanted}"
    elif isinstance(widget, (QLabel, QAbstractButton, QComboBox)) and needed.isValid():
        short = needed.width() - widget.width(), needed.height() - widget.height()
        if max(short) > SLACK_PX and not _may_shrink(widget):
            has = QWidget.size(widget).toTuple()
            yield f"{name_of(widget)}: {has} px, needs {needed.toTuple()}"
    outside = _outside(widget)
    if outside > SLACK_PX:
        yield f"{name_of(widget)}: {outside} px outside"


def _may_shrink(widget: QWidget) -> bool:
    """Whether a widget is meant to be narrower than its text, as in the header of a table."""
    return isinstance(widget.parent(), QAbstractScrollArea)


def _outside(widget: QWidget) -> int:
    """Return how far a widget is cut by its ancestors. Inside a scroll area it can be scrolled."""
    window, most = widget.window(), 0
    rect = QRect(widget.mapTo(window, QPoint()), QWidget.size(widget))
    ancestor = widget.parentWidget()
    while ancestor is not None:
        around, area = QRect(ancestor.mapTo(window, QPoint()), QWidget.size(ancestor)), None
        across = along = True
        if isinstance(ancestor.parentWidget(), QAbstractScrollArea):
            area, off = ancestor.parentWidget(), Qt.ScrollBarPolicy.ScrollBarAlwaysOff
            fixed = not isinstance(area, QTableView)
            across = fixed and area.horizontalScrollBarPolicy() == off
            along = fixed and area.verticalScrollBarPolicy() == off
        if across:
            most = max(most, around.left() - rect.left(), rect.right() - around.right())
        if along:
            most = max(most, around.top() - rect.top(), rect.bottom() - around.bottom())
        if area is not None or ancestor.isWindow():
            break
        ancestor = ancestor.parentWidget()
    return most


def _lost_actions(bar: QToolBar) -> Iterator[str]:
    """Find actions that do not fit and are not behind the arrow at the end of the bar either."""
    arrow = next((b for b in bar.findChildren(QToolButton, EXTENSION) if b.isVisible()), None)
    for action in bar.actions():
        widget = bar.widgetForAction(action)
        hidden = widget is not None and action.isVisible() and not widget.isVisible()
        if hidden and arrow is None and not action.isSeparator():
            yield f"{bar.objectName()}: {action.objectName() or widget.objectName()} is lost"


def _scrolled_sideways(area: QScrollArea) -> Iterator[str]:
    """Find pages that can only be read by scrolling along every line."""
    if area.horizontalScrollBar().maximum() > SLACK_PX:
        needed = area.viewport().width() + area.horizontalScrollBar().maximum()
        yield f"{name_of(area)}: {needed} px wide content in {area.viewport().width()}"


def _narrow_plot(plot: PlotWidget) -> Iterator[str]:
    inside = plot.getPlotItem().getViewBox().width()
    if inside < LEAST_PLOT_PX:
        yield f"{name_of(plot)}: a plot of {inside:.0f} px"


def _cut_columns(table: QTableView) -> Iterator[str]:
    header = table.horizontalHeader()
    if table.model() is None or not table.model().rowCount():
        return
    if (
        table.horizontalScrollBarPolicy() == Qt.ScrollBarPolicy.ScrollBarAlwaysOff
        and header.length() > table.viewport().width() + SLACK_PX
    ):
        yield f"{table.objectName()}: columns of {header.length()} px in {table.viewport().width()}"
