"""The list of the tools on the image, each with its first figure."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from app.measure.placing import BY_NAME
from app.measure.work import Work
from app.theme.icons import icon
from app.widgets.naming import named

KEY = Qt.ItemDataRole.UserRole


class ToolList(QListWidget):
    """Lists the tools of `work`, in which a click chooses one."""

    def __init__(self, work: Work) -> None:
        super().__init__()
        named(self, "measure.tools", "Tools on the image")
        self._work = work
        self.setIconSize(QSize(16, 16))
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.itemClicked.connect(lambda item: work.choose(item.data(KEY)))

    def refresh(self) -> None:
        """Show the present tools."""
        self.clear()
        for key, tool in self._work.sheet.items():
            answer = self._work.answer_of(key)
            value = "" if answer.refused else "…"
            if answer.result is not None:
                value = answer.result.figures[0].text.partition(" ")[0]
            kind = BY_NAME[tool.name]
            item = QListWidgetItem(icon(kind.icon), f"{kind.label} {value}")
            item.setData(KEY, key)
            self.addItem(item)
            if key == self._work.chosen:
                self.setCurrentItem(item)
