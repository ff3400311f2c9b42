"""The reflectance step: the curves' editor, made ready from the session's ball presses."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from app.calibrate.controller import CalibrationController
from app.calibrate.jobs import Job
from app.calibrate.lut_editor import LutEditor
from app.calibrate.lut_effect import Effect, ball_effect
from app.calibrate.lut_model import Curve, CurveEdit, start_edit, with_curves
from app.widgets.naming import named
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.scatter import ReflectanceScatter, gather_scatter
from gelpolight_core.session.decisions import Point
from gelpolight_core.translation import tr

Material = tuple[CurveEdit, CurveEdit, ReflectanceScatter, Callable[[CurveEdit, str], Effect]]


class CurveStep(QWidget):
    """Holds the editor; makes it anew when the presses behind the curves have changed.

    Parameters
    ----------
    controller : CalibrationController
        Of the session; an edit becomes one of its decisions.
    """

    def __init__(self, controller: CalibrationController) -> None:
        super().__init__()
        named(self, "curves", tr("Reflectance curves"))
        self._controller = controller
        self.editor: LutEditor | None = None
        self._made_of: object = None
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._said = named(QLabel(), "curves.said", tr("Why there is no curve"))
        self._said.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._said.setWordWrap(True)
        self._column.addWidget(self._said, 1)

    def take_results(self) -> None:
        """Show the present curves; says so where there are none yet."""
        project = self._controller.project
        present = project.results.reflectance
        current = Stage.REFLECTANCE not in project.stale() and present is not None
        if not current:
            self.close_editor()
            self._said.setText(tr("The curves come with the ball presses. Capture them first."))
            self._said.show()
            return
        if present is self._made_of:
            return
        self._made_of = present
        self.close_editor()
        self._said.setText(tr("Gathering the pixels of the ball presses."))
        self._said.show()
        self._controller.jobs.submit(
            Job(tr("Gathering the scatter"), lambda _tell: _gather(project), self._show, self._fail)
        )

    def close_editor(self) -> None:
        """Let the editor and its thread go."""
        if self.editor is not None:
            self.editor.stop()
            self._column.removeWidget(self.editor)
            self.editor.deleteLater()
            self.editor = None

    def _fail(self, sentence: str) -> None:
        self._made_of = None
        self._said.setText(sentence)

    def _show(self, material: Material) -> None:
        fitted, state, scatter, effect = material
        self.close_editor()
        self._said.hide()
        self.editor = LutEditor(state, scatter, previous=fitted, effect=effect)
        self.editor.edited.connect(self._on_edited)
        self._column.addWidget(self.editor, 1)

    def _on_edited(self, state: CurveEdit) -> None:
        curves: dict[int, tuple[Point, ...]] = {}
        for channel, (curve, fit) in enumerate(zip(state.curves, state.fits, strict=True)):
            if curve != fit:
                curves[channel] = tuple(zip(curve.cosines, curve.values, strict=True))
        self._controller.edit_curves(curves)


def _gather(project: CalibrationProject) -> Material:
    run = project.finish(model="paper")
    session = project.session
    fitted = start_edit(run.reflectance.table)
    edited = {
        channel: Curve(tuple(c for c, _ in nodes), tuple(v for _, v in nodes))
        for channel, nodes in session.decisions.curves.items()
    }
    scatter = gather_scatter(run, session)
    return fitted, with_curves(fitted, edited), scatter, ball_effect(run, session)
