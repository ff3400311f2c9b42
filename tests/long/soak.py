"""Let a random person use the program on the virtual sensor: ``soak.py FOLDER MINUTES SEED``.

Every half minute everything that is open is closed, and the Inspect page is measured at rest.
FOLDER holds ``sensor.gplcal`` of a quarter of the virtual sensor's size, and takes what is written:
actions.log, hung.log, and rests.json for ``test_soak.py``.
"""

import faulthandler
import gc
import json
import os
import random
import re
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
FOLDER, MINUTES, SEED = Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
for place in ("CONFIG_HOME", "DATA_HOME", "STATE_HOME", "DOCUMENTS_DIR"):
    (FOLDER / place.lower()).mkdir(parents=True)
    os.environ[f"XDG_{place}"] = str(FOLDER / place.lower())
os.environ["HOME"] = str(FOLDER)
# With threads, Mesa's renderer keeps the memory of its largest drawings: tens of megabytes an hour.
os.environ["LP_NUM_THREADS"] = "0"

from PySide6.QtCore import QModelIndex, QPoint, Qt, QTimer  # noqa: E402
from PySide6.QtGui import QAction  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import (  # noqa: E402
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
    QMenu,
    QScrollBar,
    QTabBar,
    QWidget,
)
from qt_tree import find_children  # noqa: E402
from shiboken6 import isValid  # noqa: E402

from app.measure.measurement_model import MeasurementModel  # noqa: E402
from app.measure.press_view import PressView  # noqa: E402
from app.program.jobs import JobQueue  # noqa: E402
from app.program.log import NAME  # noqa: E402
from app.sources.virtual_bench import VirtualBench  # noqa: E402
from app.views.surface.interactor import Interactor  # noqa: E402
from app.window import desktop  # noqa: E402
from app.window.main_window import MainWindow  # noqa: E402
from app.window.malloc_cache import trim_malloc_cache  # noqa: E402
from gelpolight_core.simulation.sensor_design import SensorDesign  # noqa: E402

WORKS_S, SETTLES_S, MEASURED_S, HUNG_S = 20.0, 5.0, 6.0, 60.0
# A rest that is not reached by then is measured as it is.
LONGEST_UNREST_S = 240.0
PAUSE_MS = 40, 450
RATE_HZ, SIZE = 15.0, (1400, 900)
LEFT = Qt.MouseButton.LeftButton
LEAVE = ("calibrate.leave", "inspect.stop")
# What would end the run, take away its calibration, or keep the machine busy for many minutes.
LEFT_ALONE = (
    "file.quit",
    "sensors.remove",
    "preferences.",
    "bench.rate",
    "help.board_",
    "help.documentation",
    "help.log",
)
CANVAS = QGraphicsView, Interactor
ITEMS = QComboBox, QAbstractSpinBox, QAbstractSlider, QTabBar
CONTROLS = (QAbstractButton, *ITEMS, QLineEdit, QAbstractItemView, *CANVAS)
KEYS = Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown, Qt.Key.Key_Home
TEXTS = "A 1", "press 7", "0.5", "-3", "none", "x" * 60
NEAR_THE_END = 12  # actions in a dialog
ERRANDS = (
    tuple(f"calibrate.{name}" for name in ("lay", "capture", "captures", "live", "next")),
    (
        "navigation.button.calibrate",
        "first_steps.practice",
        "question.open",
        "setup.accept",
        "calibrate.lay",
    ),
    ("navigation.button.start", "home.continue", "calibrate.captures", "calibrate.next"),
    ("navigation.button.measure", "measure.propose", "measure.tool.distance"),
    ("navigation.button.inspect", "inspect.record", "inspect.pause", "inspect.record"),
)


class Soak:
    """Acts at random and rests by turns until the time is over."""

    def __init__(self) -> None:
        windows = QApplication.topLevelWidgets()
        self.window = next(w for w in windows if isinstance(w, MainWindow))
        self.context = self.window.context
        self.random, self.resting, self.dialog_age, self.shown = random.Random(SEED), True, 0, 0
        self.next: deque[Callable[[], object]] = deque()
        self.rows: list[tuple[float, ...]] = []
        self.began_s = time.monotonic()
        self.actions = (FOLDER / "actions.log").open("w")
        self.hung = (FOLDER / "hung.log").open("w")
        self.context.source.bench = VirtualBench(SensorDesign().scaled(0.25))
        workspace = self.context.workspace
        self.calibration = workspace.import_calibration(FOLDER / "sensor.gplcal")
        self.window.page("inspect").live_depth.shown.connect(self.count)
        self.alive = QTimer(self.window)
        self.alive.timeout.connect(
            lambda: faulthandler.dump_traceback_later(HUNG_S, file=self.hung)
        )
        self.alive.start(1000)
        self.rest()

    def count(self, _shown: object) -> None:
        self.shown += 1

    def later(self, seconds: float, act: Callable[[], object]) -> None:
        QTimer.singleShot(int(1e3 * seconds), self.window, act)

    # Rest

    def rest(self) -> None:
        self.resting = True
        self.next.clear()
        self.unrest_ends_s = time.monotonic() + LONGEST_UNREST_S
        self.close_next()

    def close_next(self) -> None:
        """Close what is open, one thing at a time, until nothing is, and nothing is computed."""
        dialogs = (w for w in QApplication.topLevelWidgets() if isinstance(w, QDialog))
        upper = QApplication.activePopupWidget() or QApplication.activeModalWidget()
        upper = upper or next((dialog for dialog in dialogs if dialog.isVisible()), None)
        works = [
            *find_children(self.window, JobQueue),
            *find_children(self.window, MeasurementModel),
        ]
        if upper is not None:
            upper.close()
        elif self.window.page_name != "inspect":
            self.press("navigation.button.inspect")
        elif not any(part.busy for part in works) or time.monotonic() > self.unrest_ends_s:
            self.arrange()
            self.later(SETTLES_S, lambda: setattr(self, "shown", 0))
            self.later(SETTLES_S + MEASURED_S, self.measure)
            return
        self.later(0.2, self.close_next)

    def arrange(self) -> None:
        """Leave sessions, runs and images, and show the same scene as at every rest."""
        for name in LEAVE:
            for action in list(find_children(self.window, QAction, name)):
                action.trigger()
            for button in list(find_children(self.window, QAbstractButton, name)):
                button.click()
        for press_view in list(find_children(self.window, PressView)):
            press_view.release()
        page, source = self.window.page("inspect"), self.context.source
        page.recorder.stop()
        if page.live.paused:
            page.pause_action.trigger()
        self.window.showNormal()
        self.window.resize(*SIZE)
        if self.context.workspace.in_use != self.calibration:
            self.context.workspace.use(self.calibration)
            self.context.requests.calibrations_changed.emit()
        source.choose_virtual_sensor()
        for fault in tuple(source.bench.conditions.faults):
            source.bench.switch(fault, False)
        source.bench.place_object("ball")
        source.bench.set_conditions(rate_hz=RATE_HZ, noise=1.0, gain_db=0.0)

    def measure(self) -> None:
        gc.collect()  # what refers to itself only waits for that, and is no leak
        trim_malloc_cache()
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        memory_mb = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
        minutes = (time.monotonic() - self.began_s) / 60.0
        counts = threading.active_count(), len(QApplication.allWidgets())
        self.rows.append((minutes, memory_mb, self.shown / MEASURED_S, *counts))
        self.note(str(self.rows[-1]))
        if minutes < MINUTES:
            self.resting = False
            self.act()
            self.later(WORKS_S, self.rest)
            return
        self.alive.stop()
        faulthandler.cancel_dump_traceback_later()
        files = sorted(self.context.log.folder.glob(f"{NAME}*"))
        lines = "".join(file.read_text("utf-8") for file in files).splitlines()
        # A message to the user that something is impossible is no error of the program.
        errors = [line for line in lines if re.search(r" (ERROR|CRITICAL) ", line)]
        errors = [e for e in errors if "services.toasts" not in e or "fault of this program" in e]
        (FOLDER / "rests.json").write_text(json.dumps({"rows": self.rows, "errors": errors}))
        self.window.close()

    # Work

    def note(self, what: str) -> None:
        print(f"{time.monotonic() - self.began_s:9.2f} {what}", file=self.actions, flush=True)

    def act(self) -> None:
        if self.resting:
            return
        # Before the action: a menu or dialog that it opens may wait within it for what follows.
        self.later(1e-3 * self.random.randint(*PAUSE_MS), self.act)
        popup, modal = QApplication.activePopupWidget(), QApplication.activeModalWidget()
        if self.next:
            self.next.popleft()()
        elif popup is not None:
            self.at_popup(popup)
        elif modal is not None:
            self.at_dialog(modal)
        else:
            self.dialog_age = 0
            work = (self.touch_page, self.touch_window, self.errand, self.shortcut, self.menu,
                    self.resize)  # fmt: skip
            self.random.choices(work, (50, 15, 25, 10, 5, 3))[0]()

    def touch_page(self) -> None:
        self.touch(self.window.page(self.window.page_name or "sensors"))

    def touch_window(self) -> None:
        self.touch(self.window)

    def touch(self, root: QWidget) -> None:
        """Use a control, of a kind that is chosen first: there are more spin boxes than views."""
        kinds: dict[type, list[QWidget]] = {}
        for widget in find_children(root, QWidget):
            kind = next((k for k in CONTROLS if isinstance(widget, k)), None)
            if kind is not None and can_be_used(widget):
                kinds.setdefault(kind, []).append(widget)
        if kinds:
            self.use(self.random.choice(kinds[self.random.choice(list(kinds))]))

    def press(self, name: str) -> None:
        """Use the control or action of a name, if there is one that can be used."""
        for widget in find_children(self.window, QWidget, name):
            if can_be_used(widget):
                self.use(widget)
                return
        for action in find_children(self.window, QAction, name):
            if action.isEnabled():
                self.note(f"action {name}")
                action.trigger()
                return

    def errand(self) -> None:
        for name in self.random.choice(ERRANDS):
            self.next.append(lambda name=name: self.press(name))

    def use(self, widget: QWidget) -> None:
        """Use a control as its kind is used."""
        self.note(f"{type(widget).__name__} {widget.objectName() or '(no name)'}")
        if isinstance(widget, QAbstractButton):
            middle = widget.rect().center()
            QTest.mouseClick(
                widget, LEFT, pos=QPoint(10, middle.y()) if widget.isCheckable() else middle
            )
        elif isinstance(widget, ITEMS):
            QTest.keyClick(widget, self.random.choice(KEYS))
        elif isinstance(widget, QLineEdit):
            widget.selectAll()
            QTest.keyClicks(widget, self.random.choice(TEXTS))
            QTest.keyClick(widget, Qt.Key.Key_Return)
        elif isinstance(widget, QAbstractItemView):
            self.use_item(widget)
        else:
            self.drag(widget)

    def use_item(self, view: QAbstractItemView) -> None:
        model, top = view.model(), QModelIndex()
        if model is None or model.rowCount(top) == 0:
            return
        index = model.index(self.random.randrange(model.rowCount(top)), 0, top)
        view.scrollTo(index)
        QTest.mouseClick(view.viewport(), LEFT, pos=view.visualRect(index).center())

    def drag(self, view: QWidget) -> None:
        """Drag over a view within the next moments."""
        target = view.viewport() if isinstance(view, QGraphicsView) else view
        sides = max(1, target.width()), max(1, target.height())
        places = [QPoint(*map(self.random.randrange, sides)) for _ in range(4)]
        button = self.random.choice((LEFT, LEFT, LEFT, Qt.MouseButton.RightButton))
        steps = [(QTest.mousePress, button, places[0]), (QTest.mouseRelease, button, places[-1])]

        def act(step: Callable[..., object], button: Qt.MouseButton, place: QPoint) -> None:
            if isValid(target) and target.isVisible():
                step(target, button, pos=place)

        def move(place: QPoint) -> None:
            if isValid(target) and target.isVisible():
                QTest.mouseMove(target, place)

        moves = [lambda place=place: move(place) for place in places]
        self.next.extend((lambda: act(*steps[0]), *moves, lambda: act(*steps[1])))

    def at_popup(self, popup: QWidget) -> None:
        view = next(find_children(popup, QAbstractItemView), None)
        if isinstance(popup, QMenu) and self.random.random() < 0.8:
            actions = [a for a in popup.actions() if may_be_used(a) and not a.isSeparator()]
            if actions:
                action = self.random.choice(actions)
                self.note(f"menu {action.objectName() or action.text()}")
                QTest.mouseClick(popup, LEFT, pos=popup.actionGeometry(action).center())
                return
        elif view is not None and self.random.random() < 0.8:
            self.use_item(view)
            return
        self.note("Escape from a menu")
        QTest.keyClick(popup, Qt.Key.Key_Escape)

    def at_dialog(self, dialog: QWidget) -> None:
        self.dialog_age += 1
        line = next(find_children(dialog, QLineEdit, "fileNameEdit"), None)
        if isinstance(dialog, QFileDialog) and line is not None and self.dialog_age < 3:
            line.setText(str(FOLDER / f"{len(self.rows)}-{self.random.randrange(1000)}"))
            QTest.keyClick(line, Qt.Key.Key_Return)
        elif self.dialog_age > NEAR_THE_END or self.random.random() < 0.15:
            self.note(f"Escape from {dialog.objectName() or type(dialog).__name__}")
            QTest.keyClick(dialog, Qt.Key.Key_Escape)
        else:
            self.touch(dialog)

    def shortcut(self) -> None:
        actions = [a for a in find_children(self.window, QAction) if not a.shortcut().isEmpty()]
        actions = [a for a in actions if may_be_used(a)]
        if actions:
            action = self.random.choice(actions)
            self.note(f"{action.shortcut().toString()} ({action.objectName()})")
            QTest.keySequence(self.window, action.shortcut())

    def menu(self) -> None:
        bar = self.window.menuBar()
        action = self.random.choice(bar.actions())
        QTest.mouseClick(bar, LEFT, pos=bar.actionGeometry(action).center())

    def resize(self) -> None:
        self.window.resize(self.random.randint(1000, 1900), self.random.randint(700, 1150))


def may_be_used(part: QAction | QWidget) -> bool:
    """Return whether a person of a soak may use an action or a control."""
    return part.isVisible() and part.isEnabled() and not part.objectName().startswith(LEFT_ALONE)


def can_be_used(widget: QWidget) -> bool:
    """Return whether a control may be used and is no part of another."""
    part = isinstance(widget, QScrollBar) or widget.objectName().startswith("qt_")
    inner = isinstance(widget, QLineEdit) and isinstance(
        widget.parentWidget(), QAbstractSpinBox | QComboBox
    )
    return may_be_used(widget) and not (part or inner or widget.visibleRegion().isEmpty())


if __name__ == "__main__":
    application, soaks = desktop.make_application(), []
    QTimer.singleShot(2000, application, lambda: soaks.append(Soak()))
    sys.exit(desktop.run([]))
