"""The reflectance step: the curves' editor, made ready from the session's ball presses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import is_

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.calibrate.controller import CalibrationController
from app.calibrate.lut_editor import LutEditor
from app.calibrate.lut_effect import Effect, ball_effect
from app.calibrate.lut_model import Curve, CurveEdit, start_edit, with_curves
from app.shell.jobs import Job
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.scatter import ReflectanceScatter, gather_scatter
from gelpolight_core.session.decisions import Point
from gelpolight_core.translation import tr

Material = tuple[CurveEdit, CurveEdit, ReflectanceScatter, Callable[[CurveEdit, str], Effect]]
Nodes = dict[int, tuple[Point, ...]]


class CurveStep(QWidget):
    """Holds the editor; makes it anew when the presses behind the curves have changed.

    Edits are corrections of the session like all others, in its one history: undoing one puts the
    decisions back, and the editor shows them.

    Parameters
    ----------
    controller : CalibrationController
        Of the session.
    """

    def __init__(self, controller: CalibrationController) -> None:
        super().__init__()
        named(self, "curves", tr("Reflectance curves"))
        self._controller = controller
        self.editor: LutEditor | None = None
        self._fitted: CurveEdit | None = None
        self._made_of: tuple[object, object] | None = None
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._said = named(PlainLabel(), "curves.said", tr("Why there is no curve"))
        self._said.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._said.setWordWrap(True)
        self._column.addWidget(self._said, 1)

    def take_results(self) -> None:
        """Show the present curves; says so where there are none yet."""
        project = self._controller.project
        present = project.results.reflectance
        if present is None or Stage.REFLECTANCE in project.stale():
            self.close_editor()
            self._made_of = None
            waits = self._controller.jobs.busy
            self._say(
                tr("The curves are being fitted.")
                if waits
                else tr("The curves come with the ball presses: complete the earlier steps first.")
            )
            return
        made_of = present, project.results.balls
        if self._made_of is not None and all(map(is_, made_of, self._made_of)):
            return
        self._made_of = made_of
        self.close_editor()
        self._say(tr("Gathering the pixels of the ball presses."))
        self._controller.jobs.submit(
            Job(
                tr("Gathering the scatter"),
                lambda _tell: _gather(project),
                self._show,
                self._say,
                stopped=self._on_stopped,
            )
        )

    def close_editor(self) -> None:
        """Let the editor and its thread go."""
        if self.editor is not None:
            self.editor.stop()
            self._column.removeWidget(self.editor)
            self.editor.deleteLater()
            self.editor = None

    def _say(self, sentence: str) -> None:
        self._said.setText(sentence)
        self._said.show()

    def _on_stopped(self, sentence: str) -> None:
        self._made_of = None  # the next look gathers anew
        self._say(sentence)

    def _show(self, material: Material) -> None:
        fitted, state, scatter, effect = material
        self.close_editor()
        self._said.hide()
        self._fitted = fitted
        self.editor = LutEditor(
            state, scatter, previous=fitted, effect=effect, history=self._on_edit
        )
        self._column.addWidget(self.editor, 1)

    def _on_edit(self, text: str, before: CurveEdit, after: CurveEdit) -> None:
        assert self._fitted is not None
        fitted = self._fitted
        self._controller.correct(
            text, partial(self._put, fitted, after), partial(self._put, fitted, before),
            Stage.REFLECTANCE,
        )  # fmt: skip

    def _put(self, fitted: CurveEdit, state: CurveEdit) -> None:
        """Decide on curves, and show them; an editor of other presses shows the nodes alone."""
        nodes = _nodes(state, fitted)
        self._controller.project.edit_curves(nodes)
        if self.editor is not None and self._fitted is not None:
            same = self._fitted is fitted
            self.editor.show_state(state if same else with_curves(self._fitted, _curves(nodes)))


def _nodes(state: CurveEdit, fitted: CurveEdit) -> Nodes:
    """Return the nodes of the curves that are not as the session's stage has fitted them."""
    return {
        channel: tuple(zip(curve.cosines, curve.values, strict=True))
        for channel, (curve, fit) in enumerate(zip(state.curves, fitted.curves, strict=True))
        if curve != fit
    }


def _curves(nodes: Nodes) -> dict[int, Curve]:
    return {
        channel: Curve(tuple(c for c, _ in points), tuple(v for _, v in points))
        for channel, points in nodes.items()
    }


def _gather(project: CalibrationProject) -> Material:
    run = project.finish(model="paper")
    session = project.session
    fitted = start_edit(project.results.reflectance.table)
    scatter = gather_scatter(run, session)
    edited = _curves(dict(session.decisions.curves))
    return fitted, with_curves(fitted, edited), scatter, ball_effect(run, session)
