"""A person who uses the program at random, through its real widgets."""

from __future__ import annotations

import random
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

from PySide6.QtCore import QAbstractItemModel, QModelIndex, QPoint, Qt, QTimer
from PySide6.QtGui import QAction, QContextMenuEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QFileDialog,
    QGraphicsView,
    QLineEdit,
    QListView,
    QMenu,
    QScrollBar,
    QTabBar,
    QWidget,
)
from shiboken6 import isValid

from app.shell.main_window import MainWindow
from app.view3d.interactor import Interactor
from app.widgets.qt_tree import below

PAUSE_MS = 40, 450
LEFT = Qt.MouseButton.LeftButton
# What would end the run, take away its calibration, keep the machine busy for many minutes, or
# change what the run is measured with.
LEFT_ALONE = (
    "file.quit",
    "sensors.remove",
    "precision.start",
    "preferences.workspace",
    "bench.rate_hz",
    "bench.exposure_ms",
    "help.board_",
)
CANVAS = (QGraphicsView, Interactor)
CONTROLS = (
    QAbstractButton,
    QComboBox,
    QAbstractSpinBox,
    QAbstractSlider,
    QTabBar,
    QLineEdit,
    QAbstractItemView,
    *CANVAS,
)
KEYS = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown, Qt.Key.Key_Home)
STEP_KEYS = (Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down)
TEXTS = ("A 1", "press 7", "0.5", "-3", "none", "x" * 60)
LONGEST_DIALOG = 12


class Person:
    """Acts every now and then, one small thing at a time, and writes down each.

    Parameters
    ----------
    window : MainWindow
        Of the program.
    scratch : Path
        Where files may be saved.
    log : file
        Takes a line for every action.
    seed : int
        Of what is done.
    """

    def __init__(self, window: MainWindow, scratch: Path, log: TextIO, seed: int) -> None:
        self.window, self.scratch, self._log = window, scratch, log
        self.random = random.Random(seed)
        self.actions = 0
        self.resting = True
        self._began_s = time.monotonic()
        self._next: deque[Callable[[], object]] = deque()
        self._dialog_age = self._saved = 0
        self._errands: tuple[tuple[int, Callable[[], object]], ...] = (
            (40, lambda: self._touch(self._page())),
            (12, lambda: self._touch(self.window)),
            (10, self._shortcut),
            (9, self._go_to_page),
            (8, self._drag_on_canvas),
            (5, self._menu),
            (4, self._calibrate),
            (6, self._capture),
            (4, self._correct),
            (4, self._measure),
            (2, self._record),
            (2, self._source),
            (3, self._resize),
        )

    def note(self, what: str) -> None:
        """Write down what is done."""
        self._log.write(f"{time.monotonic() - self._began_s:9.2f}  {what}\n")
        self._log.flush()

    def begin(self) -> None:
        """Begin to act."""
        self.resting = False
        self._again()

    def rest(self) -> None:
        """Act no more, and let go of everything."""
        self.resting = True
        self._next.clear()

    def _again(self) -> None:
        QTimer.singleShot(self.random.randint(*PAUSE_MS), self.window, self._act)

    def _act(self) -> None:
        if self.resting:
            return
        # Before the action: a menu or dialog that it opens may wait within it for what follows.
        self._again()
        self.actions += 1
        if self._next:
            self._next.popleft()()
            return
        popup, modal = QApplication.activePopupWidget(), QApplication.activeModalWidget()
        if popup is not None:
            self._at_popup(popup)
        elif modal is not None:
            self._at_dialog(modal)
        else:
            self._dialog_age = 0
            self._at_work()

    def _at_work(self) -> None:
        dialogs = [w for w in QApplication.topLevelWidgets() if _is_dialog(w)]
        if dialogs and self.random.random() < 0.4:
            self._at_dialog(self.random.choice(dialogs))
            return
        weights, errands = zip(*self._errands, strict=True)
        self.random.choices(errands, weights)[0]()

    # What may be touched

    def _page(self) -> QWidget:
        return self.window.page(self.window.page_name or "sensors")

    def _touch(self, root: QWidget) -> None:
        """Use a control, of a kind that is chosen first: there are more spin boxes than views."""
        kinds: dict[type, list[QWidget]] = {}
        for widget in below(root, QWidget):
            if isinstance(widget, CONTROLS) and can_be_used(widget):
                kinds.setdefault(next(k for k in CONTROLS if isinstance(widget, k)), []).append(
                    widget
                )
        if kinds:
            self.use(self.random.choice(kinds[self.random.choice(list(kinds))]))

    def press(self, name: str) -> bool:
        """Click on a control that can be used; whether there is one."""
        for widget in below(self.window, QWidget, name):
            if can_be_used(widget):
                self.use(widget)
                return True
        return False

    def use(self, widget: QWidget) -> None:
        """Use a control as its kind is used."""
        self.note(f"{type(widget).__name__} {widget.objectName() or '(no name)'}")
        if isinstance(widget, QAbstractButton):
            middle = widget.rect().center()
            place = QPoint(10, middle.y()) if widget.isCheckable() else middle
            QTest.mouseClick(widget, LEFT, pos=place)
        elif isinstance(widget, QComboBox):
            if self.random.random() < 0.5:
                QTest.mouseClick(widget, LEFT)
            else:
                QTest.keyClick(widget, self.random.choice(KEYS))
        elif isinstance(widget, QAbstractSpinBox | QAbstractSlider):
            QTest.keyClick(widget, self.random.choice(KEYS))
        elif isinstance(widget, QTabBar):
            tab = widget.tabRect(self.random.randrange(max(1, widget.count())))
            QTest.mouseClick(widget, LEFT, pos=tab.center())
        elif isinstance(widget, QLineEdit):
            widget.selectAll()
            QTest.keyClicks(widget, self.random.choice(TEXTS))
            QTest.keyClick(widget, Qt.Key.Key_Return)
        elif isinstance(widget, QAbstractItemView):
            self._use_items(widget)
        else:
            self._drag(widget)

    def _use_items(self, view: QAbstractItemView) -> None:
        model, top = view.model(), QModelIndex()
        if model is None or model.rowCount(top) == 0:
            return
        column = 0 if isinstance(view, QListView) else self.random.randrange(columns_of(model))
        index = model.index(self.random.randrange(model.rowCount(top)), column, top)
        place = view.visualRect(index).center()
        if not view.viewport().rect().contains(place):
            view.scrollTo(index)
            place = view.visualRect(index).center()
        way = self.random.random()
        QTest.mouseClick(view.viewport(), LEFT, pos=place)
        if way < 0.2 and isValid(view):
            reason = QContextMenuEvent.Reason.Mouse
            event = QContextMenuEvent(reason, place, view.viewport().mapToGlobal(place))
            QApplication.sendEvent(view.viewport(), event)
        elif way < 0.4 and isValid(view):
            QTest.keyClick(view, self.random.choice(STEP_KEYS))

    def _drag(self, widget: QWidget) -> None:
        """Drag over a view within the next moments, or turn the wheel over it."""
        target = widget.viewport() if isinstance(widget, QGraphicsView) else widget
        places = list(self._path(target))
        button = self.random.choice((LEFT, LEFT, LEFT, Qt.MouseButton.RightButton))
        self._next.append(lambda: _if_there(target, QTest.mousePress, button, pos=places[0]))
        for place in places:
            self._next.append(lambda place=place: _if_there(target, QTest.mouseMove, place))
        self._next.append(lambda: _if_there(target, QTest.mouseRelease, button, pos=places[-1]))

    def _path(self, widget: QWidget) -> Iterator[QPoint]:
        for _ in range(self.random.randint(1, 6)):
            x = self.random.randrange(max(1, widget.width()))
            yield QPoint(x, self.random.randrange(max(1, widget.height())))

    # Menus and dialogs

    def _at_popup(self, popup: QWidget) -> None:
        view = next(below(popup, QAbstractItemView), None)
        if isinstance(popup, QMenu):
            actions = [a for a in popup.actions() if a.isEnabled() and may_be_used(a.objectName())]
            actions = [a for a in actions if a.isVisible() and not a.isSeparator()]
            if actions and self.random.random() < 0.8:
                action = self.random.choice(actions)
                self.note(f"menu {action.objectName() or action.text()}")
                QTest.mouseClick(popup, LEFT, pos=popup.actionGeometry(action).center())
                return
        elif view is not None and self.random.random() < 0.8:
            self._use_items(view)
            if isValid(view) and view.isVisible():
                QTest.keyClick(view, Qt.Key.Key_Return)
            return
        self.note("Escape from a menu")
        QTest.keyClick(popup, Qt.Key.Key_Escape)

    def _at_dialog(self, dialog: QWidget) -> None:
        self._dialog_age += 1
        if isinstance(dialog, QFileDialog):
            self._choose_file(dialog)
        elif self._dialog_age > LONGEST_DIALOG or self.random.random() < 0.15:
            self.note(f"Escape from {dialog.objectName() or type(dialog).__name__}")
            QTest.keyClick(dialog, Qt.Key.Key_Escape)
        else:
            self._touch(dialog)

    def _choose_file(self, dialog: QFileDialog) -> None:
        wanted = self._path_for(dialog)
        line = next(below(dialog, QLineEdit, "fileNameEdit"), None)
        if wanted is None or line is None or self._dialog_age > 2:
            self.note(f"Escape from {dialog.windowTitle()}")
            QTest.keyClick(dialog, Qt.Key.Key_Escape)
            return
        self.note(f"{dialog.windowTitle()}: {wanted}")
        line.setText(str(wanted))
        QTest.keyClick(line, Qt.Key.Key_Return)

    def _path_for(self, dialog: QFileDialog) -> Path | None:
        if dialog.acceptMode() == QFileDialog.AcceptMode.AcceptSave:
            self._saved += 1
            suffix = dialog.nameFilters()[0].rpartition("*")[2].rstrip(")") or ".txt"
            return self.scratch / "saved" / f"{self._saved}{suffix}"
        if dialog.windowTitle() == "Recording":
            return next(self.scratch.rglob("*.gplrec"), None)
        return None

    # Errands

    def _go_to_page(self) -> None:
        self.press(f"navigation.button.{self.random.choice(list(self.window.entries))}")

    def _shortcut(self) -> None:
        actions = [a for a in below(self.window, QAction) if self._has_keys(a)]
        if actions:
            action = self.random.choice(actions)
            self.note(f"{action.shortcut().toString()} ({action.objectName()})")
            QTest.keySequence(self.window, action.shortcut())

    def _has_keys(self, action: QAction) -> bool:
        owner = action.parent()
        seen = not isinstance(owner, QWidget) or owner.isVisible()
        keys = not action.shortcut().isEmpty()
        return keys and seen and action.isEnabled() and may_be_used(action.objectName())

    def _menu(self) -> None:
        bar = self.window.menuBar()
        action = self.random.choice(bar.actions())
        self.note(f"menu {action.text()}")
        QTest.mouseClick(bar, LEFT, pos=bar.actionGeometry(action).center())

    def _drag_on_canvas(self) -> None:
        page = self._page()
        found = [w for w in below(page, QWidget) if isinstance(w, CANVAS)]
        found = [w for w in found if can_be_used(w)]
        if found:
            self.use(self.random.choice(found))

    def _calibrate(self) -> None:
        """Come nearer to a wizard that takes images."""
        self.press("navigation.button.calibrate")
        names = ("calibrate.next", "setup.accept", "start.recent.0", "start.demo", "calibrate.lay")
        self._next.extend(lambda name=name: self.press(name) for name in names)

    def _capture(self) -> None:
        if self.press("calibrate.lay"):
            self._next.append(lambda: self.press("calibrate.capture"))
        elif not self.press("protocol.bench"):
            self.press("navigation.button.calibrate")

    def _correct(self) -> None:
        """Choose an image, leave it out or take it in, and undo that."""
        self.press("calibrate.captures")
        for name in ("calibrate.undo", "calibrate.redo", "calibrate.live"):
            if self.random.random() < 0.5:
                self._next.append(lambda name=name: self.press(name))

    def _measure(self) -> None:
        self.press("navigation.button.measure")
        tools = [
            w.objectName()
            for w in below(self.window, QAbstractButton)
            if w.objectName().startswith(("measure.tool.", "measure.propose"))
        ]
        if tools:
            tool = self.random.choice(tools)
            self._next.append(lambda: self.press(tool))
            self._next.append(self._drag_on_canvas)

    def _record(self) -> None:
        """Record for some actions' length."""
        self.press("navigation.button.inspect")
        self._next.append(lambda: self._trigger("inspect.record"))
        self._next.extend([lambda: self._touch(self._page())] * 5)
        self._next.append(lambda: self._trigger("inspect.record"))

    def _trigger(self, name: str) -> None:
        action = next(below(self.window, QAction, name), None)
        if action is not None and action.isEnabled():
            self.note(f"action {name}")
            action.trigger()

    def _source(self) -> None:
        self.press(f"{self.window.page_name}.source")

    def _resize(self) -> None:
        width, height = self.random.randint(1000, 1900), self.random.randint(700, 1150)
        self.note(f"window of {width} x {height}")
        self.window.resize(width, height)
        if self.random.random() < 0.2:
            QTest.keySequence(self.window, "F11")


def may_be_used(name: str) -> bool:
    """Return whether a person of a soak may use what has this name."""
    return not name.startswith(LEFT_ALONE)


def can_be_used(widget: QWidget) -> bool:
    """Return whether a control is seen, enabled, and no part of another."""
    part = isinstance(widget, QScrollBar) or widget.objectName().startswith("qt_")
    inner = isinstance(widget, QLineEdit) and isinstance(
        widget.parentWidget(), QAbstractSpinBox | QComboBox
    )
    return (
        widget.isVisible()
        and widget.isEnabled()
        and not part
        and not inner
        and not widget.visibleRegion().isEmpty()
        and may_be_used(widget.objectName())
    )


def columns_of(model: QAbstractItemModel) -> int:
    """Return how many columns a table has, at least one."""
    return max(1, model.columnCount(QModelIndex()))


def _is_dialog(widget: QWidget) -> bool:
    return isinstance(widget, QDialog) and widget.isVisible()


def _if_there(widget: QWidget, act: Callable[..., object], *values: object, **more: object) -> None:
    if isValid(widget) and widget.isVisible():
        act(widget, *values, **more)
