"""A second sensor beside the first: a live session with a camera and a calibration of its own."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QGridLayout,
    QSizePolicy,
    QToolBar,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.bench.bench_area import BenchArea
from app.context.context import AppContext, SourceChoice
from app.context.source_button import SourceButton
from app.inspect.export_control import ExportControl
from app.inspect.quality_panel import legend
from app.inspect.record_control import RecordControl
from app.live.advice import advise
from app.live.banner import Banner
from app.live.calibration_choice import CalibrationBox
from app.live.depth import LiveDepth
from app.live.frame_results import Shown, Wanted
from app.live.height_panel import HeightPanel
from app.live.session import LiveSession
from app.live.zero import SECOND_SUFFIX, ZeroControl
from app.services.jobs import Jobs
from app.services.status import StatusModel
from app.view2d.display import Display
from app.widgets.actions import make_action
from app.widgets.label import MarkupLabel, PlainLabel, plain_tip
from app.widgets.naming import named
from app.widgets.units import in_unit
from app.workspace.workspace import SECOND_STATE, Workspace
from gelpolight_core.measurement.map_processing import usable
from gelpolight_core.translation import tr

CLOSE_S = 1.0
"""Longest time to wait for a calibration that is being read when the pane is closed."""


def second_context(context: AppContext) -> AppContext:
    """Return a context with a source, a calibration in use, and cameras of its own."""
    status = StatusModel()
    return replace(
        context,
        status=status,
        source=SourceChoice(tr("the second sensor")),
        workspace=Workspace(context.workspace.folder, state=SECOND_STATE),
        cameras=context.cameras.beside(status),
    )


class SecondSensor(QWidget):
    """The height map of a second sensor, with its source, its calibration and its health.

    Parameters
    ----------
    context : AppContext
        Of the first sensor.

    Attributes
    ----------
    depth : LiveDepth
        The live session.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "second", tr("Second sensor"))
        self._first, self.context = context, second_context(context)
        context.requests.calibrations_changed.connect(self._follow_workspace)
        self.jobs = Jobs("second sensor jobs", self)
        self.box = CalibrationBox(page="second")
        live = LiveSession(context=self.context, name="second sensor", parent=self)
        self.depth = LiveDepth(live, self.jobs, self.box, context=self.context)
        self.zero = ZeroControl(live, self.jobs, context=self.context, suffix=SECOND_SUFFIX)
        self.recorder = RecordControl(self.depth, self, context=self.context, page="second", key="")
        self.export = ExportControl(
            self.depth, self.jobs, self, context=self.context, page="second", key="",
            folder="depth-2",
        )  # fmt: skip
        self.banner = Banner(
            self.jobs, idle=tr("Press an object into the membrane."), page="second", narrow=True
        )
        self.height = HeightPanel(page="second")
        self._bench: QDialog | None = None
        self._bench_key = named(QToolButton(), "second.bench", tr("Virtual bench"))
        self._bench_key.setText(tr("Bench…"))
        self._depth_text = named(PlainLabel(), "second.depth", tr("Largest depth"))
        self._flags = named(MarkupLabel(), "second.flags", tr("Flags"))
        self._display, self._visible = Display(), False
        self._shown: Shown | None = None
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        source = SourceButton(context=self.context, page="second", none=tr("No camera"))
        zero = make_action(
            self, "second.zero", tr("Zero"), self.zero.set_zero, icon_name="zero",
            tip=tr("Use the current image as the zero reference"),
        )  # fmt: skip
        self.box.setMinimumContentsLength(8)
        self._bench_key.clicked.connect(self.show_bench)
        for widget in (source, self.box, self._bench_key):
            widget.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        bar = QToolBar()
        bar.addActions((self.recorder.action, zero, self.export.action))
        # Its text is the state of the recording.
        bar.widgetForAction(self.recorder.action).setToolButtonStyle(
            Qt.ToolButtonStyle.ToolButtonTextBesideIcon
        )
        rows = QGridLayout()
        rows.addWidget(source, 0, 0)
        rows.addWidget(self._bench_key, 0, 1)
        rows.addWidget(self.box, 1, 0, 1, 2)
        rows.addWidget(bar, 2, 0, 1, 2)
        rows.setColumnStretch(0, 1)
        rows.setContentsMargins(4, 4, 4, 0)
        foot = QVBoxLayout()
        foot.setContentsMargins(8, 2, 8, 2)
        foot.addWidget(self._depth_text)
        foot.addWidget(self._flags)
        for text in (self._depth_text, self._flags):
            text.setWordWrap(True)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(rows)
        column.addWidget(self.banner)
        column.addWidget(self.height, 1)
        column.addLayout(foot)

    def _connect(self) -> None:
        depth, source = self.depth, self.context.source
        depth.shown.connect(self._show)
        depth.calibration_loaded.connect(depth.choose)
        depth.calibration_switched.connect(self._forget)
        depth.changed.connect(lambda: self.banner.advise(advise(depth.state)))
        depth.live.source_changed.connect(self._on_source)
        depth.live.switched.connect(self._follow_source)
        self.banner.act_wanted.connect(self._on_act)
        self.jobs.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        source.other, self._first.source.other = self._first.source, source
        source.changed.connect(self._remember)
        source.choose_again(*self.context.settings.second_source, self.context.cameras)

    # Called by the page

    def enter(self) -> None:
        """Show the source through the calibration."""
        self.depth.enter()

    def leave(self) -> None:
        """Release the source."""
        self.recorder.stop()
        self.depth.live.enter(False)

    def finish(self) -> None:
        """Release the source, the threads and the camera for good."""
        self.recorder.close()
        self._first.source.other = None
        self._first.requests.calibrations_changed.disconnect(self._follow_workspace)
        self.context.source.changed.disconnect(self._remember)
        self.context.source.choose(None)
        self.jobs.close(CLOSE_S)
        self.depth.finish()

    def want(self, display: Display, *, visible: bool) -> None:
        """Use the display settings of the first sensor, and compute only what is visible."""
        self._display, self._visible = display, visible
        still = self.depth.live.paused
        self.depth.want(Wanted(height=visible, display=display, still=still))

    def pause(self, on: bool) -> None:
        """Freeze the image at full detail, or continue."""
        self.depth.live.pause(on)
        self.want(self._display, visible=self._visible)

    def show_texts(self) -> None:
        """Show the largest depth and the flags of the newest height map."""
        heightmap = None if self._shown is None else self._shown.heightmap
        work = filter(None, (self.depth.rate_text(), self.depth.trace_text()))
        self._depth_text.setToolTip(plain_tip("\n\n".join(work)))
        if heightmap is None:
            self._depth_text.clear()
            self._flags.clear()
            return
        depth_mm = heightmap.depth_mm[usable(heightmap)]
        largest = in_unit(float(depth_mm.max())) if depth_mm.size else tr("unknown")
        texts = [tr("Largest depth {d}").format(d=largest)]
        info, note = self.context.source.info, self.context.status.value.camera_note
        if note and info is not None and info.kind == "camera":
            texts.append(tr("camera {note}").format(note=note))
        self._depth_text.setText("    ".join(texts))
        self._flags.setText(legend(heightmap.flags))

    def show_again(self) -> None:
        """Show the last frame in another unit."""
        if self._shown is not None:
            self._show(self._shown)
        self.show_texts()

    # Slots

    def _show(self, shown: Shown) -> None:
        self._shown = shown
        self.height.show_frame(shown, self._display.colours, still=self.depth.live.paused)

    def _on_source(self) -> None:
        self.recorder.stop()
        self._forget()

    def _forget(self) -> None:
        """Clear the depth, because it belongs to another calibration or source."""
        self._shown = None
        self.height.map.say(tr("No depth yet."))
        self.show_texts()

    def show_bench(self) -> None:
        """Show the bench of the virtual sensor in a window of its own."""
        if self._bench is None:
            self._bench = named(QDialog(self), "second.bench.window", tr("Virtual bench"))
            self._bench.setWindowTitle(tr("Virtual bench of the second sensor"))
            area = BenchArea(self.context.source)
            area.follow()
            QVBoxLayout(self._bench).addWidget(area)
        self._bench.show()
        self._bench.raise_()

    def _follow_source(self) -> None:
        # The frozen image belongs to the closed stream and cannot be processed again.
        self.pause(False)
        info = self.context.source.info
        virtual = info is not None and info.kind == "virtual"
        self._bench_key.setVisible(virtual)
        if self._bench is not None and not virtual:
            self._bench.hide()

    def _follow_workspace(self) -> None:
        self.context.workspace.folder = self._first.workspace.folder

    def _remember(self) -> None:
        self.context.settings.second_source = self.context.source.remembered

    def _on_act(self, name: str) -> None:
        if name == "zero":
            self.zero.set_zero()
        else:
            self.depth.act(name)
