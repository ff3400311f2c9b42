"""The curve editor with the data of the session's ball presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from operator import is_

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.calibrate.model import WizardModel
from app.calibrate.reflectance.lut_editor import LutEditor
from app.calibrate.reflectance.lut_effect import Effect, ball_effect
from app.calibrate.reflectance.lut_model import CurveSet, fitted_curves, with_nodes
from app.services.jobs import Job
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.calibration.ball_stage import BALLS, REFLECTANCE
from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.recipes import JOINT, PAPER
from gelpolight_core.calibration.scatter import ReflectanceScatter, gather_scatter
from gelpolight_core.calibration.status import StageState
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.session.decisions import Point
from gelpolight_core.translation import tr

Material = tuple[ReflectanceTable, ReflectanceScatter, Callable[[CurveSet, str], Effect]]


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
        self._fitted: CurveSet | None = None
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
        if present is None or REFLECTANCE.key in project.stale():
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
        self._made_of = None  # collected again when the tab is next shown
        self._show_message(sentence)

    def _show(self, material: Material) -> None:
        table, scatter, effect = material
        self.close_editor()
        self._message.hide()
        self._fitted = fitted_curves(table)
        stored = self._model.project.session.decisions.curves
        present = with_nodes(self._fitted, stored)
        self.editor = LutEditor(table, present, scatter, effect=effect, history=self._on_edit)
        self._column.addWidget(self.editor, 1)

    def _on_edit(self, text: str, after: CurveSet) -> None:
        fitted, before = self._fitted, self._model.project.session.decisions.curves
        nodes = {k: c.points for k, c in enumerate(after) if fitted and c != fitted[k]}
        self._model.correct(
            text, partial(self._put, nodes), partial(self._put, dict(before)), REFLECTANCE.key
        )

    def _put(self, nodes: Mapping[int, tuple[Point, ...]]) -> None:
        """Store the nodes of edited curves and show them."""
        self._model.project.edit_curves(nodes)
        if self.editor is not None and self._fitted is not None:
            self.editor.show_curves(with_nodes(self._fitted, nodes))


def _gather(project: Project) -> Material:
    known = project.statuses()[JOINT.key].state in (StageState.PASS, StageState.WARN)
    run = project.finish(None if known else PAPER)
    return run.results[REFLECTANCE].table.table, gather_scatter(run), ball_effect(run)
