"""Buttons, and actions that menus, buttons and shortcuts share and that can be undone."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence, QUndoCommand, QUndoStack
from PySide6.QtWidgets import QMenu, QPushButton, QToolButton, QWidget

from .icons import icon
from .label import plain_tip
from .widget_names import set_names

Slot = Callable[[], object]


def push_button(
    name: str, text: str, slot: Slot, *, icon_name: str = "", accessible: str = "", tip: str = ""
) -> QPushButton:
    """Return a push button.

    Parameters
    ----------
    name : str
        Object name, a dotted path.
    text : str
        On the button.
    slot : callable
        Called without arguments.
    icon_name : str, optional
        A name of :mod:`app.widgets.icons`.
    accessible : str, optional
        Text for screen readers. Default: that on the button.
    tip : str, optional
        Tooltip.
    """
    button = QPushButton(text)
    _finish(button, name, accessible or text, slot, icon_name, tip)
    return button


def tool_button(
    name: str, text: str, slot: Slot, *, icon_name: str = "", accessible: str = "", tip: str = ""
) -> QToolButton:
    """Return a flat button, see :func:`push_button`."""
    button = QToolButton()
    button.setText(text)
    button.setAutoRaise(True)
    _finish(button, name, accessible or text, slot, icon_name, tip)
    return button


def _finish(
    button: QPushButton | QToolButton,
    name: str,
    accessible: str,
    slot: Slot,
    icon_name: str,
    tip: str,
) -> None:
    if icon_name:
        button.setIcon(icon(icon_name))
    button.clicked.connect(lambda _checked=False: slot())
    set_names(button, name, accessible.replace("&", ""), tip)


UndoFunction = Callable[[], object]


class UndoStep(QUndoCommand):
    """A step of two functions. One that returns False failed, and the step leaves the history.

    Parameters
    ----------
    text : str
        Text for the menu.
    redo, undo : callable
        Do it, and undo it.
    """

    def __init__(self, text: str, redo: UndoFunction, undo: UndoFunction) -> None:
        super().__init__(text)
        self._redo, self._undo = redo, undo

    def redo(self) -> None:
        """Do it."""
        self.setObsolete(self._redo() is False)

    def undo(self) -> None:
        """Undo it."""
        self.setObsolete(self._undo() is False)


REDO = "Ctrl+Shift+Z", "Ctrl+Y"


def make_action(
    parent: QWidget,
    name: str,
    text: str,
    slot: Callable[[], object],
    *,
    keys: tuple[str, ...] = (),
    icon_name: str = "",
    tip: str = "",
    checkable: bool = False,
    inside: bool = False,
) -> QAction:
    """Return an action of a widget. Its shortcut works while the widget is visible.

    Parameters
    ----------
    parent : QWidget
        The action belongs to it and is added to it.
    name : str
        A dotted path.
    text : str
        Text with ``&`` before the mnemonic letter.
    slot : callable
        Called without arguments.
    keys : tuple of str, optional
        Shortcuts such as ``Ctrl+O``. The tooltip names the first one. An empty one stands for none.
    icon_name : str, optional
        A name of :mod:`app.widgets.icons`.
    tip : str, optional
        Tooltip.
    checkable : bool, optional
        Whether it is on or off.
    inside : bool, optional
        Whether its shortcut works only while the focus is inside the widget.
    """
    action = QAction(text, parent, checkable=checkable)
    action.setObjectName(name)
    keys = tuple(filter(None, keys))
    action.setShortcuts([QKeySequence(key) for key in keys])
    if inside:
        action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
    if icon_name:
        action.setIcon(icon(icon_name))
    if tip or keys:
        tooltip = tip or text.replace("&", "").rstrip("….")
        action.setToolTip(plain_tip(tooltip, keys[0] if keys else ""))
    action.triggered.connect(lambda _checked=False: slot())
    parent.addAction(action)
    return action


def add_item(
    menu: QMenu, name: str, text: str, slot: Callable[[], object], *, checkable: bool = False
) -> QAction:
    """Add an entry without a key to a menu."""
    action = menu.addAction(text)
    action.setObjectName(name)
    action.setCheckable(checkable)
    action.triggered.connect(lambda _checked=False: slot())
    return action


def undo_actions(
    parent: QWidget, page: str, stack: QUndoStack, titles: tuple[str, str] | None = None
) -> tuple[QAction, QAction]:
    """Return the actions of a page for undo and redo, enabled while they can act."""
    undo, redo = titles or ("Undo", "Redo")
    actions = (
        make_action(parent, f"{page}.undo", undo, stack.undo, keys=("Ctrl+Z",), icon_name="undo"),
        make_action(parent, f"{page}.redo", redo, stack.redo, keys=REDO, icon_name="redo"),
    )
    for action, can in zip(actions, (stack.canUndoChanged, stack.canRedoChanged), strict=True):
        action.setEnabled(False)
        can.connect(action.setEnabled)
    return actions


def icon_button(action: QAction) -> QToolButton:
    """Return a button for an action, with its icon or, without one, with its text."""
    button = set_names(QToolButton(), f"{action.objectName()}.button", action.text())
    button.setDefaultAction(action)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return button


def action_button(action: QAction, *, primary: bool = False) -> QPushButton:
    """Return a push button that follows text, state and tooltip of an action."""
    button = set_names(
        QPushButton(), f"{action.objectName()}.button", action.text().replace("&", "")
    )
    button.setProperty("primary", primary)
    button.clicked.connect(lambda _=False: action.trigger())

    def follow() -> None:
        button.setText(action.text())
        button.setIcon(action.icon())
        button.setEnabled(action.isEnabled())
        button.setCheckable(action.isCheckable())
        button.setChecked(action.isChecked())
        button.setToolTip(plain_tip(action.toolTip()))

    action.changed.connect(follow)
    action.toggled.connect(lambda _on: follow())
    follow()
    return button
