"""A dialog with a title and buttons below its parts, and a question with answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QRegularExpression, Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from .inputs import refusal
from .label import PlainLabel
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


class QuestionDialog(Dialog):
    """A sentence with one button for each answer, and Cancel. Enter chooses the first answer.

    Parameters
    ----------
    parent : QWidget
        The window that waits for the answer.
    title, text : str
        Title of the dialog, and the question.
    answers : tuple of (label, callable)
        Buttons, with functions that are called after the question is closed.
    """

    def __init__(
        self,
        parent: QWidget,
        title: str,
        text: str,
        answers: tuple[tuple[str, Callable[[], object]], ...],
    ) -> None:
        super().__init__(parent, "question", title, Kinds.Cancel, once=True)
        text_label = set_names(PlainLabel(text, self, wrap=True), "question.text", text)
        text_label.setMinimumWidth(460)
        for number, (label, act) in enumerate(answers):
            button = set_names(QPushButton(label, self), f"question.answer{number}", label)
            button.setDefault(number == 0)
            self.buttons.addButton(button, QDialogButtonBox.ButtonRole.ActionRole)
            button.clicked.connect(self.accept)
            button.clicked.connect(act)
        set_names(self.buttons.button(Kinds.Cancel), "question.cancel", "Cancel")
        self.fill(text_label)

    def prefer_cancel(self) -> None:
        """Let Enter choose Cancel: the answers discard something."""
        cancel = self.buttons.button(Kinds.Cancel)
        cancel.setDefault(True)
        cancel.setFocus()

    def require_text(self, hint: str, most: int) -> QLineEdit:
        """Add a line of text without which no answer can be chosen. Return it."""
        line = set_names(
            QLineEdit(self, placeholderText=hint, maxLength=most), "question.line", hint
        )
        column = self.layout()
        assert isinstance(column, QVBoxLayout)
        column.insertWidget(1, line)
        for button in self.findChildren(QPushButton, QRegularExpression("question.answer")):
            button.setEnabled(False)
            line.textChanged.connect(lambda text, b=button: b.setEnabled(bool(text.strip())))
        line.setFocus()
        return line


def ask(
    parent: QWidget, title: str, text: str, *answers: tuple[str, Callable[[], object]]
) -> QuestionDialog:
    """Ask a question in front of a window, and return it."""
    question = QuestionDialog(parent, title, text, answers)
    question.open()
    return question
