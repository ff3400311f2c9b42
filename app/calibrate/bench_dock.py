"""The virtual bench next to the wizard, shown when the virtual sensor is the camera."""

from __future__ import annotations

from PySide6.QtWidgets import QDockWidget, QWidget

from app.bench.bench_area import BenchArea
from app.calibrate.step_data import Step
from app.context.context import SourceChoice
from app.sources.bench import Scene
from app.widgets.layout import scroll_area
from app.widgets.naming import named
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class BenchDock(QDockWidget):
    """Holds the bench panel and places on the bench the object that a step needs.

    Parameters
    ----------
    source : SourceChoice
        The source selection shared by all pages, with its bench.
    parent : QWidget
        Parent window.
    """

    def __init__(self, source: SourceChoice, parent: QWidget) -> None:
        super().__init__(tr("Virtual bench"), parent)
        named(self, "calibrate.bench", tr("Virtual bench"))
        self._source = source
        self._area = BenchArea(source)
        self.setWidget(scroll_area(self._area))
        self._tried = 0
        self._grab_offset: tuple[float, float] | None = None
        self.hide()

    @property
    def in_use(self) -> bool:
        """Whether the virtual sensor is the camera."""
        info = self._source.info
        return info is not None and info.kind == "virtual" and self._source.bench is not None

    def follow(self) -> None:
        """Show the dock's action only if the virtual sensor is the camera."""
        in_use = self._area.follow()
        self.toggleViewAction().setVisible(in_use)
        if not in_use:
            self.hide()

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
        if self._source.bench is not None and self.isVisible():
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
