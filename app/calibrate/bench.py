"""The virtual bench below the steps, offered when the virtual sensor is the camera."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.bench.bench_area import BenchArea
from app.calibrate.step_data import Step
from app.context.context import SourceChoice
from app.sources.bench import Scene
from app.widgets.fold import Fold
from app.widgets.layout import scroll_area, vbox
from app.widgets.naming import named
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

AREA_HEIGHT = 280


class BenchPart(QWidget):
    """Holds the bench panel, folded, and places on the bench the object that a step needs.

    Parameters
    ----------
    source : SourceChoice
        The source selection shared by all pages, with its bench.

    Signals
    -------
    opened(bool)
        The panel was opened or folded.
    """

    opened = Signal(bool)

    def __init__(self, source: SourceChoice) -> None:
        super().__init__()
        named(self, "calibrate.bench", tr("Virtual bench"))
        self._source = source
        self._area = BenchArea(source)
        self._scroll = scroll_area(self._area)
        self._scroll.setMinimumHeight(AREA_HEIGHT)
        fold = Fold("calibrate.bench.shown", tr("Virtual bench"), self._scroll)
        self.toggle = fold.title
        self.toggle.toggled.connect(self.opened)
        vbox((fold, 100), None, of=self, margins=0)
        self._tried = 0
        self._grab_offset: tuple[float, float] | None = None
        self.hide()

    @property
    def in_use(self) -> bool:
        """Whether the virtual sensor is the camera."""
        info = self._source.info
        return info is not None and info.kind == "virtual" and self._source.bench is not None

    @property
    def open_width(self) -> int:
        """Width that the open panel needs."""
        bar = self._scroll.verticalScrollBar()
        return self._area.minimumSizeHint().width() + bar.sizeHint().width()

    def follow(self) -> None:
        """Offer the bench only if the virtual sensor is the camera."""
        in_use = self._area.follow()
        self.setVisible(in_use)
        if not in_use:
            self.toggle.setChecked(False)

    def lay(self, step: Step, session: Session) -> Scene | None:
        """Place the object that a step needs; each call gives the next view or press."""
        bench = self._source.bench
        if bench is None:
            return None
        folder, count = step.folder, self._tried
        if folder:
            count = len(session.found(folder))
        else:
            folder, self._tried = "presses", self._tried + 1
        return bench.show(folder, count % bench.steps(folder))

    def drag_to(self, u: float, v: float) -> None:
        """Move the object on the bench to the clicked point of the live image."""
        if self._source.bench is not None and self.toggle.isChecked():
            self._source.bench.drag_to(u, v)

    def drag(self, phase: str, u: float, v: float) -> None:
        """Move the object on the bench with a drag, keeping the grabbed point under the pointer.

        Parameters
        ----------
        phase : str
            "begin", "move" or "end".
        u, v : float
            Position of the pointer, image pixels.
        """
        bench = self._source.bench
        position = None if bench is None else bench.position_mm(u, v)
        if bench is None or position is None:
            return
        if phase == "begin":
            scene = bench.scene
            self._grab_offset = scene.x_mm - position[0], scene.y_mm - position[1]
        elif self._grab_offset is not None:
            bench.arrange(
                x_mm=position[0] + self._grab_offset[0], y_mm=position[1] + self._grab_offset[1]
            )
            if phase == "end":
                self._grab_offset = None
