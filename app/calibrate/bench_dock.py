"""The virtual bench beside the wizard, where the virtual sensor is the camera."""

from __future__ import annotations

from PySide6.QtWidgets import QDockWidget, QScrollArea, QWidget

from app.calibrate.steps import Step
from app.shell.context import SourceChoice
from app.sources.bench import Scene
from app.widgets.naming import named
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class BenchDock(QDockWidget):
    """Holds the bench's panel, and lays on the bench what a step asks for.

    Parameters
    ----------
    source : SourceChoice
        The choice that all pages share, with its bench.
    parent : QWidget
        The window.
    """

    def __init__(self, source: SourceChoice, parent: QWidget) -> None:
        super().__init__(tr("Virtual bench"), parent)
        named(self, "calibrate.bench", tr("Virtual bench"))
        self._source = source
        self._tried = 0
        self._held: tuple[float, float] | None = None
        self.hide()

    @property
    def in_use(self) -> bool:
        """Whether the virtual sensor is the camera."""
        info = self._source.info
        return info is not None and info.kind == "virtual" and self._source.bench is not None

    def follow(self) -> None:
        """Be there only where the virtual sensor is the camera."""
        self.toggleViewAction().setVisible(self.in_use)
        if not self.in_use:
            self.hide()
        elif self.widget() is None:
            from app.bench.bench_panel import BenchPanel  # only the demo needs it

            assert self._source.bench is not None
            scroll = QScrollArea()
            scroll.setWidgetResizable(True)
            scroll.setWidget(BenchPanel(bench=self._source.bench))
            self.setWidget(scroll)

    def lay(self, step: Step, session: Session) -> Scene | None:
        """Lay down what a step asks for, each time the next view or press."""
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
        """Move what lies there to where the person clicked in the live picture."""
        if self._source.bench is not None and self.isVisible():
            self._source.bench.drag_to(u, v)

    def drag(self, phase: str, u: float, v: float) -> None:
        """Move what lies there as the person drags it, held where it was taken hold of.

        Parameters
        ----------
        phase : str
            "begin", "move" or "end".
        u, v : float
            Where the pointer is, in the picture.
        """
        bench = self._source.bench
        place = None if bench is None else bench.place_mm(u, v)
        if bench is None or place is None:
            return
        if phase == "begin":
            scene = bench.scene
            self._held = scene.x_mm - place[0], scene.y_mm - place[1]
        elif self._held is not None:
            bench.arrange(x_mm=place[0] + self._held[0], y_mm=place[1] + self._held[1])
            if phase == "end":
                self._held = None
