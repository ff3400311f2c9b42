"""Panel next to the map: the tools, the figures of the chosen one, true values, and saving."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QFormLayout,
    QFrame,
    QHeaderView,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QScrollArea,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.measure.figures_text import figure_text
from app.measure.placing import kind_label
from app.measure.truth_form import TruthForm
from app.measure.work import Work
from app.theme.icons import icon
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import vbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.tools import ToolResult
from gelpolight_core.translation import tr

WIDTH = 340
LIST_HEIGHT = 96
# In a tall window: nine tools without scrolling.
TALL_LIST = 240
KEY = Qt.ItemDataRole.UserRole


class SidePanel(QScrollArea):
    """Shows the results of the tools. Its buttons are connected by its owner.

    Signals
    -------
    tool_chosen(int)
        A tool was chosen in the list: its key.
    """

    tool_chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        named(self, "measure.panel", tr("Results"))
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFixedWidth(WIDTH)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.propose = _button("propose", tr("&Detect object"), "propose", "Q")
        self.tools = named(QListWidget(), "measure.tools", tr("Tools on the image"))
        self.tools.setMinimumHeight(LIST_HEIGHT)
        self.tools.setMaximumHeight(TALL_LIST)
        self.tools.currentItemChanged.connect(self._on_tool)
        self.remove = _button("remove", tr("Remove the tool"), "remove", "Del")
        self.figures = _figures_table()
        self.reason = named(
            PlainLabel(wrap=True), "measure.reason", tr("Why the result is doubtful")
        )
        self.truth = TruthForm()
        self.operator = named(QLineEdit(), "measure.operator", tr("Operator"))
        self.note = named(QLineEdit(placeholderText=tr("Any remark")), "measure.note", tr("Note"))
        self.keep = _button("keep", tr("Sa&ve to records"), "keep", "Ctrl+Return")
        self.keep.setMinimumHeight(36)
        self.kept = named(MarkupLabel(wrap=True), "measure.kept", tr("Last saved result"))
        form = QFormLayout()
        form.addRow(tr("Operator"), self.operator)
        form.addRow(tr("Note"), self.note)
        inside = QWidget()
        vbox(
            self.propose,
            (self.tools, 1),
            self.remove,
            self.figures,
            self.reason,
            self.truth,
            form,
            self.keep,
            self.kept,
            None,
            of=inside,
            margins=(10, 8, 10, 8),
        )
        self.setWidget(inside)

    def show_work(self, work: Work, *, known: bool) -> None:
        """Show the tools and the figures of the chosen one.

        Parameters
        ----------
        work : Work
            Holds the tools and results.
        known : bool
            Whether there is a height map to measure on.
        """
        self.propose.setEnabled(known and not work.detecting)
        self.propose.setText(tr("Detecting…") if work.detecting else tr("&Detect object"))
        self._show_tools(work)
        self.remove.setEnabled(bool(work.chosen))
        found = work.results.get(work.chosen)
        if not isinstance(found, str) and work.result is None:
            found = None
        self._show_figures(found, measuring=bool(work.chosen) and known)
        tool = work.tool
        if tool is None:
            self.truth.show_kind("", "", "mm")
        elif isinstance(found, ToolResult):
            first = found.figures[0]
            label = tr("mean side") if tool.name == "cuboid" else first.label
            self.truth.show_kind(tool.name, label, first.unit)
        self.keep.setEnabled(isinstance(found, ToolResult))

    def say_kept(self, text: str) -> None:
        """Show that a result was saved. Empty: nothing of this image was saved."""
        link = tr("Show records")
        words = f"<span style='color:@pass'>{escaped(text)}</span> <a href='records'>{link}</a>"
        self.kept.setText(words if text else "")

    def _show_tools(self, work: Work) -> None:
        with QSignalBlocker(self.tools):
            self.tools.clear()
            for key, tool in work.sheet.items():
                item = QListWidgetItem(_line(tool.name, work.results.get(key)))
                item.setIcon(icon(f"tool-{tool.name}"))
                item.setData(KEY, key)
                self.tools.addItem(item)
                if key == work.chosen:
                    self.tools.setCurrentItem(item)
            if not work.sheet:
                item = QListWidgetItem(tr("No tool yet. Choose one on the left."))
                item.setFlags(Qt.ItemFlag.NoItemFlags)
                self.tools.addItem(item)

    def _show_figures(self, found: ToolResult | str | None, *, measuring: bool) -> None:
        figures = found.figures if isinstance(found, ToolResult) else ()
        self.figures.setRowCount(len(figures))
        for row, figure in enumerate(figures):
            value = QTableWidgetItem(figure_text(figure))
            value.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            font = value.font()
            font.setBold(row == 0)
            value.setFont(font)
            self.figures.setItem(row, 0, QTableWidgetItem(figure.label))
            self.figures.setItem(row, 1, value)
        height = self.figures.verticalHeader().length() + 2 * self.figures.frameWidth()
        self.figures.setFixedHeight(
            max(height, 7 * self.figures.verticalHeader().defaultSectionSize())
        )
        text, role = "", "muted"
        if isinstance(found, str):
            text, role = found, "fail"
        elif isinstance(found, ToolResult) and found.verdict != "ok":
            text, role = tr("Doubtful: {reason}").format(reason=found.reason), "warn"
        elif measuring and found is None:
            text = tr("Measuring…")
        self.reason.setText(text)
        show_meaning(self.reason, role)

    def _on_tool(self, item: QListWidgetItem | None) -> None:
        if item is not None and item.data(KEY) is not None:
            self.tool_chosen.emit(item.data(KEY))


def _line(name: str, found: ToolResult | str | None) -> str:
    label = kind_label(name)
    if isinstance(found, ToolResult):
        return f"{label}   {figure_text(found.figures[0])}"
    value = tr("not measured") if isinstance(found, str) else "…"
    return f"{label}   {value}"


def _button(name: str, text: str, icon_name: str, key: str) -> QPushButton:
    plain = text.replace("&", "")
    button = named(QPushButton(text), f"measure.{name}", plain, plain, key)
    button.setIcon(icon(icon_name))
    button.setAutoDefault(False)
    return button


def _figures_table() -> QTableWidget:
    table = named(QTableWidget(0, 2), "measure.figures", tr("Figures of the chosen tool"))
    table.horizontalHeader().hide()
    table.verticalHeader().hide()
    table.verticalHeader().setDefaultSectionSize(24)
    table.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
    table.horizontalHeader().setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    table.setShowGrid(False)
    table.setAlternatingRowColors(True)
    return table
