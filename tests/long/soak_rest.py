"""Bring the program to the state in which a soak measures it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QApplication, QCheckBox, QComboBox, QDialog
from soak_person import Person

from app.measure.press_view import PressView
from app.measure.work import Work
from app.services.jobs import Jobs
from app.shell.main_window import MainWindow
from app.view3d.surface import LIVE_NODES
from app.widgets.qt_tree import below

UNSETTLED = "the images do not settle"
COMPUTES = "something is being computed"
RATE_HZ = 15.0
SIZE = 1400, 900
# Without depth by then, the first rest says that there is none.
LONGEST_STEPS = 30


class Rest:
    """Closes what is open and arranges the Inspect page, one thing at a time.

    Parameters
    ----------
    window : MainWindow
        Of the program.
    person : Person
        Uses its buttons.
    calibration : Path or None
        Of the virtual sensor.
    """

    def __init__(self, window: MainWindow, person: Person, calibration: Path | None) -> None:
        self.window, self.person = window, person
        self._wanted, self._calibration = calibration, None
        self.shown = 0  # frames
        self._watched = False
        self.begin(emptied=False)

    def begin(self, *, emptied: bool) -> None:
        """Come to rest anew; emptied: nothing that a person opened is left open."""
        self._emptied, self._arranged, self._advised = emptied, False, False
        self._shown_before = self.shown

    @property
    def computes(self) -> bool:
        """Whether any part of the program works on something."""
        parts = [*below(self.window, Jobs), *below(self.window, Work)]
        return any(part.busy for part in parts)

    def first_uses(self) -> Iterator[None]:
        """Use once what is compiled and loaded when it is used first; wait after each step."""
        self.window.show_page("inspect")
        yield
        if self._wanted is None:
            return
        page = self.window.page("inspect")
        self.window.context.source.choose_virtual_sensor()
        self._arrange()
        for _ in range(LONGEST_STEPS):
            if page.depth.last is not None and page.depth.last.heightmap is not None:
                break
            yield
        modes = page.findChild(QComboBox, "inspect.mode")
        for index in range(modes.count()):
            modes.setCurrentIndex(index)
            modes.activated.emit(index)
            yield
        yield from self._draw_largest()
        self.window.show_page("measure")
        yield
        press_view = self.window.page("measure").press_view
        for _ in range(LONGEST_STEPS):
            press_view.freeze()
            yield
            if press_view.work.image is not None:
                break
        press_view.work.propose()
        yield
        press_view.release()

    def _draw_largest(self) -> Iterator[None]:
        """Draw a standing image with all its nodes; a renderer in software keeps that room."""
        page = self.window.page("inspect")
        self.window.showFullScreen()
        page.pause_action.trigger()
        for _ in range(LONGEST_STEPS):
            yield
            surface = page.depth.last.surface
            if surface is not None and max(surface.depth_mm.shape) > LIVE_NODES:
                break
        yield
        page.pause_action.trigger()
        self.window.showNormal()

    def undone(self) -> str:
        """Do the next thing that is not as at rest; return what it is, empty when all is."""
        popup = QApplication.activePopupWidget()
        if popup is not None:
            popup.close()
            return "a menu is open"
        dialogs = [w for w in QApplication.topLevelWidgets() if isinstance(w, QDialog)]
        dialogs = [w for w in dialogs if w.isVisible()]
        if dialogs:
            (QApplication.activeModalWidget() or dialogs[-1]).close()
            return f"the dialog {dialogs[-1].objectName() or dialogs[-1].windowTitle()} is open"
        if self.window.page_name != "inspect":
            self.person.press("navigation.button.inspect")
            return f"the page is {self.window.page_name or 'being loaded'}"
        return self._undone_at_inspect()

    def _undone_at_inspect(self) -> str:
        page, source = self.window.page("inspect"), self.window.context.source
        if not self._watched:
            self._watched = True
            page.depth.shown.connect(self._count)
        if page.recorder.busy:
            page.recorder.stop()
            return "it records"
        if self.window.isFullScreen() or (self.window.width(), self.window.height()) != SIZE:
            self.window.showNormal()
            self.window.resize(*SIZE)
        if page.live.paused:
            page.pause_action.trigger()
        for name in ("inspect.stop", "precision.stop"):
            for button in list(below(self.window, QAbstractButton, name)):
                if button.isVisible():
                    button.click()
        modes = page.findChild(QComboBox, "inspect.mode")
        if modes is not None and modes.isEnabled() and modes.currentIndex() != 0:
            modes.setCurrentIndex(0)
            modes.activated.emit(0)
        for fault in tuple(source.bench.conditions.faults):
            source.bench.switch(fault, False)
        if source.info is None or source.info.kind != "virtual":
            source.choose_virtual_sensor()
        if page.live.stream is not None and page.live.stream.figures().lost:
            page.live.open()
        if not self._arranged:
            self._arranged = True
            self._arrange()
            if self._emptied:
                self._put_away()
            # What was shown before says nothing of the arranged scene.
            self._shown_before = self.shown
        if self.computes:
            return COMPUTES
        if self.shown - self._shown_before < 5:
            return "nothing is shown"
        if page.depth.last is None or not page.depth.last.frame.settled:
            return UNSETTLED
        if self._calibration is not None and page.depth.last.heightmap is None:
            # Getting the calibration ready may have been stopped, above or by the person.
            advised = (b for b in below(page, QAbstractButton, "inspect.advised") if b.isVisible())
            button = None if self._advised else next(advised, None)
            if button is not None:
                self._advised = True
                button.click()
            return "there is no depth"
        return ""

    def _count(self, _shown: object) -> None:
        self.shown += 1

    def _arrange(self) -> None:
        page = self.window.page("inspect")
        for name in ("inspect.layout", "inspect.view_oblique"):
            action = page.findChild(QAction, name)
            if action is not None:
                action.trigger()
        page.findChild(QCheckBox, "inspect.section.region").setChecked(False)
        what = page.findChild(QComboBox, "inspect.quality.what")
        if what is not None:  # standard deviations are several times as dear as depth
            what.setCurrentIndex(0)
        self.use_calibration()
        bench = self.window.context.source.bench
        bench.lay("ball")
        bench.adjust(rate_hz=RATE_HZ, noise=1.0, gain_db=0.0)

    def _put_away(self) -> None:
        """Close the session and the protocol's run, and let go of the image that is measured."""
        for action in list(below(self.window, QAction, "calibrate.leave")):
            action.trigger()
        for name in ("protocol.leave", "protocol.leave_result"):
            for button in list(below(self.window, QAbstractButton, name)):
                button.click()
        for press_view in list(below(self.window, PressView)):
            press_view.release()

    def use_calibration(self) -> None:
        """Put the calibration into use: most of what a frame costs is its own."""
        if self._wanted is None:
            return
        context = self.window.context
        if self._calibration is None or not self._calibration.is_file():
            self._calibration = context.workspace.import_calibration(self._wanted)
        if context.workspace.in_use != self._calibration:
            context.workspace.use(self._calibration)
            context.requests.calibrations_changed.emit()
