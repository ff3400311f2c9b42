"""A part of a panel that is folded away until its title is clicked."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from .layout import vbox
from .widget_names import set_names


class CollapsibleSection(QWidget):
    """A title, and below it a widget that a click on the title shows or hides.

    Parameters
    ----------
    name : str
        Object name of the title, a dotted path.
    title : str
        Text.
    content : QWidget
        The widget.
    """

    def __init__(self, name: str, title: str, content: QWidget) -> None:
        super().__init__()
        self._content = content
        self.title = set_names(QToolButton(autoRaise=True), name, title)
        self.title.setText(title)
        self.title.setCheckable(True)
        self.title.setProperty("fold", True)
        self.title.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.title.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.title.toggled.connect(self._show)
        vbox(self.title, content, of=self, margins=0, spacing=4)
        self._show(False)

    def _show(self, unfolded: bool) -> None:
        self.title.setArrowType(Qt.ArrowType.DownArrow if unfolded else Qt.ArrowType.RightArrow)
        self._content.setVisible(unfolded)
