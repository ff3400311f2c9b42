"""Choose, add and remove section lines."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QWidget

from app.inspect.section_line import SectionLines
from app.view2d.profile_plot import line_colour
from app.widgets.buttons import tool_button
from app.widgets.inputs import ComboBox
from app.widgets.layout import hbox
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
        add, remove = tr("Add a line"), tr("Remove this line")
        self._add = tool_button(
            "inspect.section.line.add", "", self.add_wanted.emit, icon_name="add", accessible=add,
            tip=add,
        )  # fmt: skip
        self._remove = tool_button(
            "inspect.section.line.remove", "", self.remove_wanted.emit, icon_name="remove",
            accessible=remove, tip=remove,
        )  # fmt: skip
        hbox((self._box, 1), self._add, self._remove, of=self, margins=0, spacing=2)

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
