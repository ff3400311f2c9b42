"""The editor of the reflectance curves (LUT): draggable nodes, every edit can be undone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import QEvent, Qt, QTimer, Signal
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QCloseEvent,
    QKeyEvent,
    QKeySequence,
    QResizeEvent,
)
from PySide6.QtWidgets import QSplitter, QToolBar, QWidget

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_effect import Effect
from app.calibrate.reflectance.lut_live import LivePanel
from app.calibrate.reflectance.lut_model import CurveEdit
from app.calibrate.reflectance.lut_plot import CurvePlot
from app.widgets.label import RoomyLabel, plain_tip
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import CHANNEL_KEYS, channel_name
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

# Below this width, neither the curve nor its effect can be read beside the other.
NARROW = 560
NUDGE = 0.002
"""Step of an arrow key, as a share of the curve's highest value and of the cosine's range."""
NUDGES = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, 1.0),
    Qt.Key.Key_Down: (0.0, -1.0),
}
HINT = tr(
    "Drag a node to move it, click it to select it, double-click the curve to add a node, use the "
    "wheel to zoom. A node stays between its neighbours; click Fewer nodes to get more room."
)
LASSO_HINT = tr("Draw a line around the points to exclude. Press Esc to leave the lasso.")


class LutEditor(QWidget):
    """Edits the three reflectance curves.

    Parameters
    ----------
    start : CurveEdit
        Initial state, to which Reset returns.
    scatter : ReflectanceScatter
        The ball pixels that the curves were fitted to.
    previous : CurveEdit, optional
        An older version to compare with; by default `start`.
    effect : callable
        From (state, press's name) to :class:`~app.calibrate.reflectance.lut_effect.Effect`.
    history : callable
        Called with the text of an edit, the state before it and the state after it, to add the edit
        to a history. It must call :meth:`show_state` with the new state, and again after each undo
        or redo.
    """

    edited = Signal(object)

    def __init__(
        self,
        start: CurveEdit,
        scatter: ReflectanceScatter,
        *,
        previous: CurveEdit | None = None,
        effect: Callable[[CurveEdit, str], Effect],
        history: Callable[[str, CurveEdit, CurveEdit], None],
    ) -> None:
        super().__init__()
        self._history = history
        self._start = self._state = self._shown = start
        self._previous = previous or start
        self._scatter = scatter
        self.channel = 0
        self.chosen: int | None = None
        self.plot = named(CurvePlot(scatter), "lut.plot", tr("Reflectance curve"))
        self.plot.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.live = LivePanel(start, scatter.names, effect)
        self._repaint = QTimer(self, interval=1, singleShot=True)
        self._repaint.timeout.connect(self._follow_theme)
        self._notice = named(RoomyLabel(), "lut.notice", tr("Result of the last edit"))
        self._hint = named(
            RoomyLabel(HINT, LASSO_HINT, node_hint(99, 99, 0.0, 0.0)),
            "lut.hint",
            tr("How to edit"),
        )
        self._actions = self._make_actions()
        self._lay_out()
        self._connect()
        self._apply_theme()
        self.choose_channel(0)

    @property
    def state(self) -> CurveEdit:
        """The present state, without a drag in progress."""
        return self._state

    def choose_channel(self, channel: int) -> None:
        """Show the curve of another channel."""
        self.channel, self.chosen = channel, None
        self._actions[f"channel.{CHANNEL_KEYS[channel]}"].setChecked(True)
        self.plot.whole(self._state, channel)
        self._refresh()

    def choose_node(self, index: int | None) -> None:
        """Select a node of the channel for the keys and buttons."""
        self.chosen = index
        self._notice.clear()
        self._refresh()

    def stop(self) -> bool:
        """Stop the panel's thread; return whether it has stopped."""
        return self.live.stop()

    def closeEvent(self, event: QCloseEvent) -> None:
        """Stop the panel's thread."""
        self.stop()
        super().closeEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Where there is little room, put the effect of the edit below the curve, in words."""
        super().resizeEvent(event)
        narrow = self.width() < NARROW
        orientation = Qt.Orientation.Vertical if narrow else Qt.Orientation.Horizontal
        self._split.setOrientation(orientation)
        self.live.show_plots(not narrow)

    def changeEvent(self, event: QEvent) -> None:
        """Apply a changed theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_actions"):
            # Not at once: Qt is iterating over all widgets, and none may be created or deleted
            # meanwhile.
            self._repaint.start()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the selected node, or select its neighbour."""
        key = Qt.Key(event.key())
        if key in NUDGES and self.chosen is not None:
            times = 10.0 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1.0
            self._nudge(self.chosen, *(times * step for step in NUDGES[key]))
        elif key in (Qt.Key.Key_PageUp, Qt.Key.Key_PageDown):
            self._choose_neighbour(1 if key == Qt.Key.Key_PageUp else -1)
        elif key == Qt.Key.Key_Escape and self._actions["lasso"].isChecked():
            self._actions["lasso"].trigger()
        else:
            super().keyPressEvent(event)

    def _make_actions(self) -> dict[str, QAction]:
        """Return the tools; each is (key, text, tool tip, shortcut, what it does)."""
        table: list[tuple[str, str, str, str, Callable[[], object]]] = [
            (
                f"channel.{key}",
                channel_name(k).capitalize(),
                tr("Show the curve of the {name} channel").format(name=channel_name(k)),
                f"{k + 1}",
                partial(self.choose_channel, k),
            )
            for k, key in enumerate(CHANNEL_KEYS)
        ]
        table += [
            (
                "lasso",
                tr("Lasso"),
                tr("Draw around points to exclude them; the curve is then fitted again"),
                "L",
                self._on_lasso,
            ),
            (
                "reset",
                tr("Reset channel"),
                tr("Reset this channel to its initial curve"),
                "",
                partial(
                    self._do, tr("reset channel"), model.reset_channel, self._start, keep=False
                ),
            ),
            (
                "compare",
                tr("Compare"),
                tr("Show the previous version of the curve as well"),
                "C",
                self._refresh,
            ),
            (
                "view",
                tr("Whole curve"),
                tr("Show the whole curve"),
                "Home",
                lambda: self.plot.whole(self._state, self.channel),
            ),
            (
                "add",
                tr("Add node"),
                tr("Add a node in the wider gap next to the selected node"),
                "Ins",
                self._on_add,
            ),
            ("remove", tr("Remove node"), tr("Remove the selected node"), "Del", self._on_remove),
            (
                "thin",
                tr("Fewer nodes"),
                tr("Keep only the nodes that are needed to draw the same curve"),
                "F",
                partial(self._do, tr("fewer nodes"), model.thin_nodes, keep=False),
            ),
            (
                "snap",
                tr("Snap to fit"),
                tr("Move the selected node, or all nodes, onto the fitted curve"),
                "S",
                lambda: self._do(tr("snap to fit"), model.snap_to_fit, self.chosen),
            ),
            (
                "smooth",
                tr("Smooth"),
                tr("Reduce the bumps of the curve by half"),
                "M",
                partial(self._do, tr("smooth"), model.smooth),
            ),
        ]
        group = QActionGroup(self)
        actions = {}
        for key, text, tip, shortcut, act in table:
            action = actions[key] = QAction(text, self)
            action.setObjectName(f"lut.{key}")
            action.setCheckable(key in ("lasso", "compare") or key.startswith("channel"))
            action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            action.setShortcut(QKeySequence(shortcut))
            action.setToolTip(plain_tip(tip, shortcut))
            action.triggered.connect(lambda _on, act=act: act())
            self.addAction(action)
            if key.startswith("channel"):
                group.addAction(action)
        return actions

    def _bar(self, name: str, accessible: str, groups: Sequence[Sequence[str]]) -> QToolBar:
        bar = named(QToolBar(), name, accessible)
        for number, keys in enumerate(groups):
            if number:
                bar.addSeparator()
            for key in keys:
                bar.addAction(self._actions[key])
                button = bar.widgetForAction(self._actions[key])
                named(button, f"lut.{key}.button", self._actions[key].text())
                button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        return bar

    def _lay_out(self) -> None:
        channels = [f"channel.{name}" for name in CHANNEL_KEYS]
        first = (channels, ("lasso", "reset"), ("compare", "view"))
        second = (("add", "remove", "thin", "snap", "smooth"),)
        self._split = split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(self.plot)
        split.addWidget(self.live)
        split.setStretchFactor(0, 3)
        split.setStretchFactor(1, 1)
        split.setSizes([860, 400])
        vbox(
            self._bar("lut.tools", tr("Tools for the reflectance curve"), first),
            self._bar("lut.more_tools", tr("More tools for the reflectance curve"), second),
            (split, 1),
            self._hint,
            self._notice,
            of=self,
        )

    def _connect(self) -> None:
        self.plot.node_chosen.connect(self.choose_node)
        self.plot.node_moved.connect(self._on_node_moved)
        self.plot.outlined.connect(self._on_outlined)
        self.plot.asked_for_node.connect(self._add_at)

    def _follow_theme(self) -> None:
        self._apply_theme()
        self._refresh()

    def _apply_theme(self) -> None:
        self.plot.apply_theme()
        self.live.apply_theme()

    def _do(
        self,
        text: str,
        operation: Callable[..., CurveEdit],
        *details: object,
        keep: bool = True,
    ) -> None:
        """Apply an edit function of the model to the channel; `keep` the node selected."""
        try:
            after = operation(self._state, self.channel, *details)
        except InputError as error:
            self._notice.setText(str(error))
            return
        if not keep:
            self.chosen = None
        self._commit(text, after)

    def _commit(self, text: str, after: CurveEdit) -> None:
        self._notice.clear()
        if after == self._state:
            self.show_state(after)
            return
        self._history(f"{text} ({channel_name(self.channel)})", self._state, after)

    def show_state(self, state: CurveEdit) -> None:
        """Make a state the present one."""
        changed = state != self._state
        self._state = self._shown = state
        if self.chosen is not None and self.chosen >= len(state[self.channel].curve.cosines):
            self.chosen = None
        self._refresh()
        if changed:
            self.edited.emit(state)

    def _refresh(self) -> None:
        compare = self._actions["compare"].isChecked()
        previous = self._previous[self.channel].curve if compare else None
        self.plot.show_state(self._shown, self.channel, chosen=self.chosen, previous=previous)
        self._hint.setText(self._hint_text())
        curve = self._state[self.channel].curve
        inner = self.chosen is not None and 0 < self.chosen < len(curve.cosines) - 1
        self._actions["remove"].setEnabled(inner)
        changed = self._state[self.channel] != self._start[self.channel]
        self._actions["reset"].setEnabled(changed)
        self.live.show_state(self._shown)

    def _hint_text(self) -> str:
        if self._actions["lasso"].isChecked():
            return LASSO_HINT
        if self.chosen is None:
            return HINT
        curve, chosen = self._shown[self.channel].curve, self.chosen
        count = len(curve.cosines)
        return node_hint(chosen + 1, count, curve.cosines[chosen], curve.values[chosen])

    def _on_node_moved(self, index: int, cosine: float, value: float, end: bool) -> None:
        moved = model.move_node(self._state, self.channel, index, cosine, value)
        if end:
            self._commit(tr("move node"), moved)
            return
        self._shown = moved
        self._refresh()

    def _nudge(self, node: int, across: float, up: float) -> None:
        curve = self._state[self.channel].curve
        cosine = curve.cosines[node] + NUDGE * across
        value = curve.values[node] + NUDGE * up * curve.values[-1]
        moved = model.move_node(self._state, self.channel, node, cosine, value)
        if moved == self._state:
            self._notice.setText(tr("The node cannot move further in this direction."))
        else:
            self._commit(tr("move node by key"), moved)

    def _choose_neighbour(self, step: int) -> None:
        count = len(self._state[self.channel].curve.cosines)
        start = (-1 if step > 0 else count) if self.chosen is None else self.chosen
        self.choose_node(min(max(start + step, 0), count - 1))

    def _on_add(self) -> None:
        """Add a node in the wider gap next to the selected node, or in the widest gap."""
        cosines: Sequence[float] = self._state[self.channel].curve.cosines
        gaps = range(len(cosines) - 1)
        if self.chosen is not None:
            gaps = range(max(self.chosen - 1, 0), min(self.chosen + 1, len(cosines) - 1))
        gap = max(gaps, key=lambda i: cosines[i + 1] - cosines[i])
        self._add_at(0.5 * (cosines[gap] + cosines[gap + 1]))

    def _add_at(self, cosine: float) -> None:
        try:
            after, index = model.add_node(self._state, self.channel, cosine)
        except InputError as error:
            self._notice.setText(str(error))
            return
        self.chosen = index
        self._commit(tr("add node"), after)

    def _on_remove(self) -> None:
        if self.chosen is not None:
            self._do(tr("remove node"), model.remove_node, self.chosen, keep=False)

    def _on_lasso(self) -> None:
        on = self._actions["lasso"].isChecked()
        self.plot.box.lasso = on
        self.plot.nodes.setVisible(not on)
        self._refresh()

    def _on_outlined(self, outline: Sequence[tuple[float, float]]) -> None:
        before = self._state
        self._do(tr("exclude points"), model.leave_out, outline, self._scatter, keep=False)
        if self._state is not before:
            out = model.left_out_points(
                self._state[self.channel].left_out, self._scatter, self.channel
            )
            self._notice.setText(
                tr("{n} of {all} points are excluded; the curve was fitted again").format(
                    n=int(out.sum()), all=out.size
                )
            )


def node_hint(number: int, count: int, cosine: float, value: float) -> str:
    """Return the hint for the selected node.

    Parameters
    ----------
    number, count : int
        Number of the node, from 1, and number of nodes.
    cosine, value : float
        Position of the node.
    """
    return tr(
        "Node {number} of {all}: cosine {cosine:.4f}, value {value:.4f}. Arrow keys move it "
        "(Shift: ten times as far), Page Up and Page Down select its neighbours, Del removes it."
    ).format(number=number, all=count, cosine=cosine, value=value)
