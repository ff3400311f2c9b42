"""Inputs that ignore the mouse wheel until they have the focus, and the field for all numbers.

Over an input without focus the wheel scrolls the panel around it, as if the input were not there.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QSignalBlocker, QSize, Qt
from PySide6.QtGui import QFocusEvent, QHideEvent, QKeyEvent, QValidator, QWheelEvent
from PySide6.QtWidgets import QApplication, QComboBox, QDoubleSpinBox, QSlider, QToolTip, QWidget

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.number import read_number

from .label import plain_tip
from .text_roles import set_property
from .timers import timer


class _WheelNeedsFocus:
    """Mixin in front of a Qt input."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # type: ignore[attr-defined]

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Change the value if the input has the focus, else leave the event to the panel."""
        if self.hasFocus():  # type: ignore[attr-defined]
            super().wheelEvent(event)  # type: ignore[misc]
        else:
            event.ignore()


PAUSE_MS = 1500
"""A number counts as typed after so long without a key: slow typists press one key a second."""
WAITS = Qt.FocusReason.PopupFocusReason, Qt.FocusReason.ActiveWindowFocusReason
"""Reasons for which the focus leaves and comes back, to the same place in the text."""


TEXT_LEFT = 5
"""Pixels to the left of a number, as the padding of a text field."""


class NumberField(_WheelNeedsFocus, QDoubleSpinBox):
    """A field for a number, which it shows with a point on every system.

    What a person types stays as it is, whatever the program shows in the meantime. It is used at
    Return, when the focus leaves, before a click elsewhere or a shortcut, and after a pause. What
    :func:`read_number` refuses, or is outside the limits, stays and is marked; a tip says why.
    Decimals are those that are set; without them the number is whole.

    Attributes
    ----------
    refused : str
        Why the text is not used, and which number is; empty if the text is used.
    waiting : bool
        Whether something typed is not used yet.
    """

    refused, waiting = "", False
    _typed: str | None = None  # what is typed, instead of the number and the text for the lowest
    _of = 0.0  # the number for which it is shown
    _lowest, _size = "", QSize()

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"decimals": 0, "keyboardTracking": False, **options})
        self.lineEdit().setTextMargins(TEXT_LEFT, 0, 0, 0)
        self._pause = timer(self, PAUSE_MS, self._rest, once=True)
        self._says = timer(self, 0, self._say, once=True)
        self.lineEdit().textEdited.connect(self._on_typed)

    def take(self, *, keep: bool = False) -> None:
        """Use what is typed. `keep`: its text stays."""
        if self._typed is None or not (self.waiting or not keep):
            return
        self.waiting = False
        self._pause.stop()
        _application().removeEventFilter(self)
        try:
            value = self._read(self._typed)
        except InputError as error:
            self._of = self.value()
            used = self._lowest if self._is_lowest() else self._text(self._of) + self.suffix()
            until_then = f"Until then {used} is used"
            self._mark(f"{error.found}. {error.advice}. {until_then}.")
            return
        self._of = value
        if not keep:
            self._show_number()
        super().setValue(value)

    def setValue(self, value: float) -> None:
        """Show another number, but not in place of one that is being typed."""
        super().setValue(value)
        self._follow()

    def setRange(self, low: float, high: float) -> None:
        """Set the limits."""
        super().setRange(low, high)
        self._follow()

    def setSpecialValueText(self, text: str) -> None:
        """Set the text of the lowest number."""
        self._lowest = text
        if self._typed is None:
            super().setSpecialValueText(text)

    def textFromValue(self, value: float) -> str:
        """Return what is typed, or else the number."""
        return self._text(value) if self._typed is None or value != self.value() else self._typed

    def validate(self, text: str, place: int) -> tuple[QValidator.State, str, int]:
        """Let any key in: :meth:`take` reads the text."""
        return QValidator.State.Intermediate, text, place

    def stepBy(self, steps: int) -> None:
        """Count from what is typed."""
        self.take()
        self._show_number()
        super().stepBy(steps)

    def sizeHint(self) -> QSize:
        """Return the usual size, also for what is typed."""
        if self._typed is None:
            self._size = super().sizeHint() + QSize(TEXT_LEFT, 0)
        return self._size

    def event(self, event: QEvent) -> bool:
        """Show why the text is refused under the mouse, in place of the usual tip."""
        if event.type() == QEvent.Type.ToolTip and self.refused:
            self._say()
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Type over the text of the lowest number, and use what is typed at Return."""
        if self._typed is None and self._is_lowest() and event.text().isprintable():
            self.selectAll()
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.take()
            if self.refused:
                return
        super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Use what is typed."""
        self.take(keep=event.reason() in WAITS)
        super().focusOutEvent(event)

    def hideEvent(self, event: QHideEvent) -> None:
        """Use what is typed."""
        self.take()
        super().hideEvent(event)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Use what is typed before the user does something else in the program."""
        kind = event.type()
        if kind == QEvent.Type.Shortcut or (
            kind == QEvent.Type.MouseButtonPress
            and isinstance(watched, QWidget)
            and watched is not self
            and not self.isAncestorOf(watched)
        ):
            self.take(keep=True)
        return False

    def _rest(self) -> None:
        self.take(keep=True)

    def _on_typed(self, text: str) -> None:
        self._typed, self.waiting = text.removesuffix(self.suffix()), True
        super().setSpecialValueText("")
        self._mark("")
        self._pause.start()
        _application().installEventFilter(self)

    def _read(self, text: str) -> float:
        text = text.strip().removesuffix(self.suffix().strip())
        if self._lowest and text in ("", self._lowest):
            return self.minimum()
        value = read_number(text, self.accessibleName(), decimals=self.decimals())
        low, high = self.minimum(), self.maximum()
        if not low <= value <= high:
            message = f"{text} is not a number from {low:g} to {high:g}"
            raise InputError(message, self.accessibleName(), Remedy.CORRECT_VALUE)
        return value

    def _text(self, value: float) -> str:
        return f"{value:.{self.decimals()}f}"

    def _is_lowest(self) -> bool:
        return bool(self._lowest) and self.value() == self.minimum()

    def _follow(self) -> None:
        """Show the number if it is not the one for which the typed text is shown."""
        if not self.waiting and self.value() != self._of:
            self._show_number()

    def _show_number(self) -> None:
        if self._typed is not None:
            self._typed = None
            self._mark("")
            super().setSpecialValueText(self._lowest)

    def _mark(self, refused: str) -> None:
        self.refused = refused
        self.setAccessibleDescription(refused)
        set_property(self, "refused", bool(refused))
        if refused:
            self._says.start()  # when the focus is where it goes, which would hide the tip

    def _say(self) -> None:
        if self.refused and self.isVisible():
            corner = self.mapToGlobal(self.rect().bottomLeft())
            QToolTip.showText(corner, plain_tip(self.refused), self)


def _application() -> QCoreApplication:
    """Return the running application, which a field watches while something typed waits."""
    application = QApplication.instance()
    assert application is not None
    return application


def refusal(parts: QWidget) -> str:
    """Return why a number that is typed in a form is not used, and put the focus there."""
    for field in parts.findChildren(NumberField):
        field.take()
        if field.refused and field.isVisible():
            field.setFocus()
            return field.refused
    return ""


class ComboBox(_WheelNeedsFocus, QComboBox):
    """A drop-down list.

    Parameters
    ----------
    characters : int, optional
        Least width of the box; its list shows long entries in full. 0: as wide as the entries.
    """

    def __init__(self, *, characters: int = 0) -> None:
        super().__init__()
        if characters:
            self.setMinimumContentsLength(characters)
            self.setSizeAdjustPolicy(self.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)

    def offer(self, entries: Iterable[tuple[str, Any]], chosen: Any = None) -> None:
        """Show these texts with their values, and choose one, or the first, without a signal."""
        with QSignalBlocker(self):
            self.clear()
            for text, value in entries:
                self.addItem(text, value)
            self.setCurrentIndex(max(self.findData(chosen), 0))


class Slider(_WheelNeedsFocus, QSlider):
    """A slider."""
