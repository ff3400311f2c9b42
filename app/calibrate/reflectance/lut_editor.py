"""The editor of the reflectance curves (LUT), with the data of the session's ball presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from operator import is_

import numpy as np
from PySide6.QtCore import QEvent, QSignalBlocker, Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QButtonGroup,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QToolTip,
    QWidget,
)

from app.calibrate.reflectance import lut_model as model
from app.calibrate.wizard_model import WizardModel
from app.program.jobs import BackgroundJob
from app.widgets import theme
from app.widgets.actions import push_button
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import Float64Array, PointXY
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.number import read_number
from gelpolight_core.calibration.edit_effect import CurveEditEffect, EditEffectFunction, ball_effect
from gelpolight_core.calibration.joint_stage import JOINT
from gelpolight_core.calibration.open_ball_stages import BALLS, REFLECTANCE
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipes import PAPER
from gelpolight_core.calibration.reflectance_scatter import ReflectanceScatter, gather_scatter
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.light.reflectance_table import ReflectanceTable

from .lut_model import CurveSet, ReflectanceCurve
from .lut_plot import CurvePlot, PressErrorPreview

# Below this width, neither the plot nor the table can be read beside the other.
NARROW = 600


class LutEditor(QWidget):
    """Edits the three reflectance curves.

    Parameters
    ----------
    table : ReflectanceTable
        The fit to the ball presses, to which Reset returns.
    curves : CurveSet
        The present curves.
    scatter : ReflectanceScatter
        The ball pixels that the curves were fitted to.
    effect : callable
        See :func:`~gelpolight_core.calibration.edit_effect.ball_effect`.
    history : callable
        Called with the text of an edit and the curves after it. It must call :meth:`show_curves`
        with the new curves, and again after each undo or redo.
    """

    def __init__(
        self,
        table: ReflectanceTable,
        curves: CurveSet,
        scatter: ReflectanceScatter,
        *,
        effect: EditEffectFunction,
        history: Callable[[str, CurveSet], None],
    ) -> None:
        super().__init__()
        self.fitted, self._coverage = model.fitted_curves(table), table.coverage.tolist()
        self.curves, self._history = curves, history
        self.channel = 0
        self.chosen: int | None = None
        self.plot = CurvePlot(scatter, chosen=self.choose_node, moved=self._on_moved)
        set_names(self.plot, "lut.plot", "Reflectance curve")
        fit = dict(enumerate(zip(table.cosines, table.values, strict=True)))

        def effect_of(curves: CurveSet, press: str) -> CurveEditEffect:
            nodes = model.edited_nodes(curves, self.fitted)
            return effect(fit | {k: _columns(points) for k, points in nodes.items()}, press)

        self.preview = PressErrorPreview(self.fitted, scatter.names, effect_of)
        self.nodes = self._build_table()
        self._group = QButtonGroup(self)
        for k, key in enumerate(CHANNEL_KEYS):
            text, choose = CHANNEL_KEYS[k].capitalize(), partial(self.choose_channel, k)
            button = push_button(f"lut.channel.{key}", text, choose)
            button.setCheckable(True)
            self._group.addButton(button, k)
        self._reset = push_button(
            "lut.reset",
            "Reset",
            lambda: self._commit("reset channel", self.fitted[self.channel]),
            tip="Return to the curve that was fitted to the ball presses",
        )
        hint = PlainLabel("Drag a node, or type its position.", wrap=True)
        side = QWidget()
        self._side = hbox((self.nodes, 1), (self.preview, 1), of=side, margins=0, spacing=16)
        self._split = hbox((self.plot, 3), (side, 2), spacing=16)
        vbox(
            hbox(*self._group.buttons(), None, self._reset, spacing=8),
            (self._split, 1),
            hint,
            of=self,
            margins=16,
            spacing=8,
        )
        self.choose_channel(0)

    @property
    def curve(self) -> ReflectanceCurve:
        """The curve of the shown channel."""
        return self.curves[self.channel]

    def choose_channel(self, channel: int) -> None:
        """Show the curve of another channel."""
        self.channel, self.chosen = channel, None
        self._group.button(channel).setChecked(True)
        self.plot.show_channel(channel, self.fitted[channel], tuple(self._coverage[channel]))
        self._refresh()

    def choose_node(self, index: int | None) -> None:
        """Select a node."""
        self.chosen = index
        self._refresh()

    def show_curves(self, curves: CurveSet) -> None:
        """Show other curves: after an edit, an undo or a redo."""
        self.curves = curves
        self._refresh()

    def stop(self) -> bool:
        """Stop the preview's thread, and return whether it has stopped."""
        return self.preview.stop()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put table and effect below the plot if there is little width."""
        super().resizeEvent(event)
        narrow, direction = self.width() < NARROW, QBoxLayout.Direction
        self._split.setDirection(direction.TopToBottom if narrow else direction.LeftToRight)
        self._side.setDirection(direction.LeftToRight if narrow else direction.TopToBottom)

    def changeEvent(self, event: QEvent) -> None:
        """Apply a changed theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_split"):
            # Not at once: Qt is iterating over all widgets, and none may be created or deleted
            # meanwhile.
            QTimer.singleShot(1, self, self._apply_theme)

    def _apply_theme(self) -> None:
        self.preview.apply_theme()
        self.choose_channel(self.channel)

    def _build_table(self) -> QTableWidget:
        table = set_names(QTableWidget(0, 2), "lut.nodes", "Nodes of the curve")
        table.setHorizontalHeaderLabels(["Cosine", "Value"])
        table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        table.verticalHeader().hide()
        table.verticalHeader().setDefaultSectionSize(24)
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setShowGrid(False)
        table.setMinimumWidth(120)
        table.setMinimumHeight(96)
        table.currentCellChanged.connect(
            lambda row, *_: self.choose_node(row if row >= 0 else None)
        )
        table.cellChanged.connect(self._on_typed)
        return table

    def _refresh(self, dragged: ReflectanceCurve | None = None) -> None:
        """Show the present curve, or one that is being dragged."""
        curve = dragged or self.curve
        self.plot.show_curve(curve, self.channel, self.chosen)
        self.preview.show_curves(model.with_curve(self.curves, self.channel, curve))
        with QSignalBlocker(self.nodes):
            self.nodes.setRowCount(len(curve.cosines))
            for row, point in enumerate(curve.points):
                for column, number in enumerate(point):
                    self._show_number(row, column, number)
            if self.chosen is None:
                self.nodes.clearSelection()
            else:
                self.nodes.selectRow(self.chosen)
        self._reset.setEnabled(self.curve != self.fitted[self.channel])

    def _show_number(self, row: int, column: int, number: float) -> None:
        item = self.nodes.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            self.nodes.setItem(row, column, item)
        item.setText(f"{number:.4f}")
        item.setData(Qt.ItemDataRole.ForegroundRole, None)
        item.setToolTip("")

    def _commit(self, text: str, curve: ReflectanceCurve) -> None:
        """Enter an edit into the history, which shows it."""
        if curve == self.curve:
            self._refresh()
            return
        after = model.with_curve(self.curves, self.channel, curve)
        self._history(f"{text} ({CHANNEL_KEYS[self.channel]})", after)

    def _on_moved(self, index: int, cosine: float, value: float, end: bool) -> None:
        self.chosen = index
        moved = model.move_node(self.curve, index, cosine, value)
        if end:
            self._commit("move node", moved)
        else:
            self._refresh(moved)

    def _on_typed(self, row: int, column: int) -> None:
        point, item = list(self.curve.points[row]), self.nodes.item(row, column)
        head = self.nodes.horizontalHeaderItem(column)
        assert item is not None and head is not None
        try:
            point[column] = read_number(item.text(), head.text(), decimals=4)
            nearest = model.move_node(self.curve, row, *point).points[row][column]
            if abs(nearest - point[column]) > 1e-9:
                message = "{value} is not possible there, {nearest:.4f} is"
                message = message.format(value=item.text(), nearest=nearest)
                raise InputError(message, head.text(), Remedy.CORRECT_VALUE)
        except InputError as error:
            with QSignalBlocker(self.nodes):
                item.setForeground(theme.colour("fail"))
                item.setToolTip(plain_tip(str(error)))
            corner = self.nodes.visualItemRect(item).bottomLeft()
            QToolTip.showText(self.nodes.viewport().mapToGlobal(corner), item.toolTip(), self.nodes)
            return
        self._on_moved(row, point[0], point[1], True)


def _columns(points: tuple[PointXY, ...]) -> tuple[Float64Array, Float64Array]:
    cosines, values = np.array(points).T
    return cosines, values


CurveData = tuple[ReflectanceTable, ReflectanceScatter, EditEffectFunction]


class CurveEditorPanel(QWidget):
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
        set_names(self, "curves", "Reflectance curves")
        self._model = model
        self.editor: LutEditor | None = None
        self._made_of: tuple[object, object] | None = None
        self._message = PlainLabel(wrap=True)
        set_names(self._message, "curves.message", "Why there are no curves")
        self._message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._column = vbox((self._message, 1), of=self, margins=0)

    def show_results(self) -> None:
        """Show the present curves, or explain why there are none yet."""
        project = self._model.project
        present = project.results.get(REFLECTANCE)
        if present is None or REFLECTANCE.key in project.stale():
            self.close_editor()
            self._made_of = None
            reason = "The curves are fitted to the ball presses. Complete the earlier steps first."
            self._show_message("Fitting the curves." if self._model.jobs.busy else reason)
            return
        made_of = present, project.results.get(BALLS)
        if self._made_of is not None and all(map(is_, made_of, self._made_of)):
            return
        self._made_of = made_of
        self.close_editor()
        self._show_message("Collecting the pixels of the ball presses.")
        title, stopped = "Collecting the pixels", self._on_stopped
        work = partial(_gather, project)
        self._model.jobs.submit(BackgroundJob(title, work, self._show, self._show_message, stopped))

    def close_editor(self) -> None:
        """Close the editor, and end its thread."""
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

    def _show(self, material: CurveData) -> None:
        table, scatter, effect = material
        self.close_editor()
        self._message.hide()
        stored = self._model.project.session.decisions.curves
        present = model.with_nodes(model.fitted_curves(table), stored)
        self.editor = LutEditor(table, present, scatter, effect=effect, history=self._on_edit)
        self._column.addWidget(self.editor, 1)

    def _on_edit(self, text: str, after: CurveSet) -> None:
        assert self.editor is not None
        before = dict(self._model.project.session.decisions.curves)
        nodes = model.edited_nodes(after, self.editor.fitted)
        self._model.correct(text, self._put, nodes, before, REFLECTANCE.key)

    def _put(self, nodes: Mapping[int, tuple[PointXY, ...]]) -> None:
        """Store the nodes of edited curves and show them."""
        self._model.project.edit_curves(nodes)
        if self.editor is not None:
            self.editor.show_curves(model.with_nodes(self.editor.fitted, nodes))


def _gather(project: CalibrationProject, _progress: object) -> CurveData:
    is_refined = project.statuses()[JOINT.key].state in (StageState.PASS, StageState.WARN)
    run = project.finish(None if is_refined else PAPER)
    return run.results[REFLECTANCE].table.table, gather_scatter(run), ball_effect(run)
