"""A dialog with a title, and buttons below its parts."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QPushButton, QWidget

from .inputs import refusal
from .layout import vbox
from .widget_names import set_names

Kinds = QDialogButtonBox.StandardButton


class Dialog(QDialog):
    """A dialog with its parts above standard buttons, not accepted while a number is refused.

    Parameters
    ----------
    parent : QWidget or None
        The window that it belongs to.
    name : str
        Object name.
    title : str
        Title, also for screen readers.
    kinds : QDialogButtonBox.StandardButton, optional
        Standard buttons of the dialog.
    once : bool, optional
        Whether it is deleted when it is closed.

    Attributes
    ----------
    buttons : QDialogButtonBox
        The buttons.
    """

    def __init__(
        self,
        parent: QWidget | None,
        name: str,
        title: str,
        kinds: Kinds = Kinds.Close,
        *,
        once: bool = False,
    ) -> None:
        super().__init__(parent)
        set_names(self, name, title)
        self.setWindowTitle(title)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, once)
        self.buttons = QDialogButtonBox(kinds)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)

    def fill(self, *parts: Any, add: tuple[QPushButton, ...] = ()) -> None:
        """Lay out the parts above the buttons, and add buttons of its own."""
        for button in add:
            self.buttons.addButton(button, QDialogButtonBox.ButtonRole.ActionRole)
        vbox(*parts, self.buttons, of=self)

    def accept(self) -> None:
        """Accept what is entered, unless a number in it is refused."""
        if not refusal(self):
            super().accept()
