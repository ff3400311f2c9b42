"""Choose, add and remove section lines."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QWidget

from app.inspect.section_line import SectionLines
from app.theme.icons import icon
from app.view2d.profile_plot import line_colour
from app.widgets.inputs import ComboBox
from app.widgets.naming import named
from gelpolight_core.translation import tr

SAMPLE_PX = 12


class LineChoice(QWidget):
    """The list of the lines in their colours, with buttons to add and remove one.

    Signals
    -------
    chosen(int)
        The line of this number was chosen.
    add_wanted(), remove_wanted()
        The buttons.
    """

    chosen = Signal(int)
    add_wanted = Signal()
    remove_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._box = named(
            ComboBox(), "inspect.section.line", tr("Line whose values are shown"),
            tr("The values below belong to this line. A click on a line also selects it"),
        )  # fmt: skip
        self._box.activated.connect(lambda at: self.chosen.emit(self._box.itemData(at)))
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(2)
        row.addWidget(self._box, 1)
        self._add = self._button("add", tr("Add a line"), self.add_wanted)
        self._remove = self._button("remove", tr("Remove this line"), self.remove_wanted)
        row.addWidget(self._add)
        row.addWidget(self._remove)

    def _button(self, name: str, tip: str, wanted: Signal) -> QToolButton:
        button = named(QToolButton(), f"inspect.section.line.{name}", tip, tip)
        button.setIcon(icon(name))
        button.clicked.connect(lambda: wanted.emit())  # type: ignore[attr-defined]
        return button

    def show_lines(self, lines: SectionLines) -> None:
        """Show the lines, and which of them is chosen."""
        with QSignalBlocker(self._box):
            self._box.clear()
            for line in lines:
                sample = QPixmap(SAMPLE_PX, SAMPLE_PX)
                sample.fill(QColor(line_colour(line.number)))
                text = tr("Line {n}").format(n=line.number)
                self._box.addItem(QIcon(sample), text, line.number)
            self._box.setCurrentIndex(self._box.findData(lines.chosen))
        self._add.setEnabled(lines.may_add)
        self._remove.setEnabled(lines.may_remove)
