"""The reflectance step: the curve editor with the data of the session's ball presses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import is_

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.calibrate.model import WizardModel
from app.calibrate.reflectance.lut_editor import LutEditor
from app.calibrate.reflectance.lut_effect import Effect, ball_effect
from app.calibrate.reflectance.lut_model import Curve, CurveEdit, start_edit, with_curves
from app.services.jobs import Job
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.calibration.ball_stage import BALLS, REFLECTANCE
from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.recipes import PAPER
from gelpolight_core.calibration.scatter import ReflectanceScatter, gather_scatter
from gelpolight_core.calibration.status import StageState
from gelpolight_core.session.decisions import Point
from gelpolight_core.translation import tr

Material = tuple[CurveEdit, CurveEdit, ReflectanceScatter, Callable[[CurveEdit, str], Effect]]
Nodes = dict[int, tuple[Point, ...]]


class Curves(QWidget):
    """Holds the editor and creates a new one when the presses behind the curves have changed.

    Edits are corrections of the session like all others, in the same history: undoing an edit
    restores the decisions, and the editor shows them.

    Parameters
    ----------
    model : WizardModel
        Model of the wizard.
    """

    def __init__(self, model: WizardModel) -> None:
        super().__init__()
        named(self, "curves", tr("Reflectance curves"))
        self._model = model
        self.editor: LutEditor | None = None
        self._fitted: CurveEdit | None = None
        self._made_of: tuple[object, object] | None = None
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._message = named(PlainLabel(), "curves.message", tr("Why there are no curves"))
        self._message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._message.setWordWrap(True)
        self._column.addWidget(self._message, 1)

    def show_results(self) -> None:
        """Show the present curves, or explain why there are none yet."""
        project = self._model.project
        present = project.results.get(REFLECTANCE)
        if present is None or "reflectance" in project.stale():
            self.close_editor()
            self._made_of = None
            waits = self._model.jobs.busy
            self._show_message(
                tr("Fitting the curves.")
                if waits
                else tr(
                    "The curves are fitted to the ball presses. Complete the earlier steps first."
                )
            )
            return
        made_of = present, project.results.get(BALLS)
        if self._made_of is not None and all(map(is_, made_of, self._made_of)):
            return
        self._made_of = made_of
        self.close_editor()
        self._show_message(tr("Collecting the pixels of the ball presses."))
        self._model.jobs.submit(
            Job(
                tr("Collecting the pixels"),
                lambda _progress: _gather(project),
                self._show,
                self._show_message,
                stopped=self._on_stopped,
            )
        )

    def close_editor(self) -> None:
        """Close the editor and its thread."""
        if self.editor is not None:
            self.editor.stop()
            self._column.removeWidget(self.editor)
            self.editor.deleteLater()
            self.editor = None

    def _show_message(self, sentence: str) -> None:
        self._message.setText(sentence)
        self._message.show()

    def _on_stopped(self, sentence: str) -> None:
        self._made_of = None  # collected again when the step is next shown
        self._show_message(sentence)

    def _show(self, material: Material) -> None:
        fitted, state, scatter, effect = material
        self.close_editor()
        self._message.hide()
        self._fitted = fitted
        self.editor = LutEditor(
            state, scatter, previous=fitted, effect=effect, history=partial(self._on_edit, fitted)
        )
        self._column.addWidget(self.editor, 1)

    def _on_edit(self, fitted: CurveEdit, text: str, before: CurveEdit, after: CurveEdit) -> None:
        self._model.correct(
            text, partial(self._put, fitted, after), partial(self._put, fitted, before),
            "reflectance",
        )  # fmt: skip

    def _put(self, fitted: CurveEdit, state: CurveEdit) -> None:
        """Apply curves and show them; an editor of other presses shows only the nodes."""
        nodes = _nodes(state, fitted)
        self._model.project.edit_curves(nodes)
        if self.editor is not None and self._fitted is not None:
            same = self._fitted is fitted
            self.editor.show_state(state if same else with_curves(self._fitted, _curves(nodes)))


def _nodes(state: CurveEdit, fitted: CurveEdit) -> Nodes:
    """Return the nodes of the curves that differ from the fit of the session's stage."""
    return {
        channel: tuple(zip(now.curve.cosines, now.curve.values, strict=True))
        for channel, (now, fit) in enumerate(zip(state, fitted, strict=True))
        if now.curve != fit.curve
    }


def _curves(nodes: Nodes) -> dict[int, Curve]:
    return {
        channel: Curve(tuple(c for c, _ in points), tuple(v for _, v in points))
        for channel, points in nodes.items()
    }


def _gather(project: Project) -> Material:
    known = project.statuses()["joint"].state in (StageState.PASS, StageState.WARN)
    run = project.finish(None if known else PAPER)
    session = run.session
    fitted = start_edit(run.results[REFLECTANCE].table.table)
    scatter = gather_scatter(run)
    edited = _curves(dict(session.decisions.curves))
    return fitted, with_curves(fitted, edited), scatter, ball_effect(run)
