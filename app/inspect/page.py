"""The Inspect page: live depth in 3D and as maps, with one shared cursor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from app.live.banner import AdviceBanner
from app.live.calibration_choice import use_virtual_calibration
from app.live.frame_processor import FrameResult
from app.live.live_depth import LiveDepth
from app.live.live_session import LiveSession
from app.live.next_step_advice import advise
from app.live.replay_bar import ReplayBar
from app.program.context import AppContext
from app.program.jobs import JobQueue
from app.sources.virtual_bench import VirtualBench, coin_path
from app.widgets.actions import action_button, make_action
from app.widgets.label import plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label, set_text_role
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.output.recording.recording_format import ENDING

from .depth_stream import DepthStream
from .export import ExportControl, FileActions
from .inspect_views import InspectViews
from .mode_choice import ModeChoice
from .processing_panel import ProcessingSummary
from .record_control import RecordControl

LIVE = "Press an object into the membrane. Press Space to freeze it at full detail."
STORED = "Press comma or full stop for another image. Press Space to freeze it at full detail."
FROZEN = "The image is frozen. Press Space to continue."


class InspectPage(QWidget):
    """Shows the depth of the pressed membrane.

    Parameters
    ----------
    context : AppContext
        Shared by all pages.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "inspect", "Inspect")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.context = context
        self.jobs = JobQueue("inspect", self)
        self.live = LiveSession(context=context, name="inspect", parent=self)
        self.live_depth = LiveDepth(self.live, self.jobs, self, context=context)
        self.modes = ModeChoice(self.jobs, self, self.live_depth.choose, context=context)
        self._value = named_label("inspect.depth", "Depth under the cursor", wrap=False, bold=1.7)
        self._readout = named_label("inspect.readout", "Values under the cursor", role="muted")
        # For the deviation, the place and the flags, so that nothing below moves with the pointer.
        self._readout.setFixedHeight(3 * self._readout.fontMetrics().lineSpacing())
        self._readout.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._rate = named_label("inspect.rate", "Rate and processing time", role="muted")
        self._rate.setMinimumHeight(2 * self._rate.fontMetrics().lineSpacing())
        self._shown: FrameResult | None = None
        self._recorded = named_label("inspect.recorded", "State of the recording")
        self._recorded.hide()
        self._lay_out()
        self._connect()
        self.views.restore()

    def _lay_out(self) -> None:
        tip, pause = "Freeze the image at full detail", lambda: self.pause(not self.live.paused)
        # Inside: other pages use the space bar for something else.
        self.pause_action = make_action(
            self, "inspect.pause", "Freeze", pause, keys=("Space",), tip=tip, inside=True
        )
        self.pause_action.setCheckable(True)
        tip, zero = "Use the current image as the zero reference", self.live_depth.zero.set_zero
        zero_action = make_action(
            self, "inspect.zero", "Zero", zero, keys=("Ctrl+0",), icon_name="zero", tip=tip
        )
        self.recorder = RecordControl(
            self.live_depth, self, self._on_recorded, context=self.context
        )
        self.stream = DepthStream(self.live_depth, self, self._on_stream, context=self.context)
        self.export = ExportControl(self.live_depth, self.jobs, self, context=self.context)
        self.views = InspectViews(
            self.jobs,
            (
                vbox(self._value, self._readout, spacing=2),
                vbox(self.modes.box, self._recorded, self._rate),
            ),
            (
                hbox(action_button(zero_action), action_button(self.export.action), spacing=8),
                action_button(self.recorder.action),
                action_button(self.pause_action, primary=True),
            ),
            on_wanted=self._want,
            on_pointed=self._show_texts,
            on_hold=lambda: self.file_actions.hold_reference(),
            on_save=lambda: self.file_actions.save_profile(),
            context=self.context,
        )
        self.file_actions = FileActions(self.live_depth, self.views, self, context=self.context)
        self.views.surface.menu.add("mesh", "Export mesh…", self.export.ask)
        act, over = self.live_depth.act, self.views.stage.parts
        self.banner = AdviceBanner(self.jobs, idle=LIVE, on_act=act, over=over)
        self.replay = ReplayBar("inspect", lambda: self.pause(False))
        self.processed = ProcessingSummary(self.views.processing.reset)
        parts = self.banner, self.processed, (self.views, 1), self.replay
        vbox(*parts, of=self, margins=0, spacing=0)

    def _connect(self) -> None:
        self.live.source_changed.connect(self._on_source)
        self.live.switched.connect(self._on_switched)
        self.live_depth.shown.connect(self._show)
        self.live_depth.calibration_loaded.connect(self.modes.offer)
        self.live_depth.calibration_switched.connect(self._on_calibration)
        self.live_depth.changed.connect(self._advise)
        self.jobs.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        self._texts = timer(self, 250, self._show_texts)

    # Called by the main window

    def enter(self) -> None:
        """Show the source through the calibration in use."""
        self._want()
        self.live_depth.enter()
        self._texts.start()
        self.setFocus()

    def leave(self) -> None:
        """Release the source."""
        self._texts.stop()
        self.recorder.stop()
        self.live.enter(False)
        self.views.keep()

    def unfinished(self) -> str:
        """Return what would end if the window was closed. Empty: nothing."""
        running = self.recorder.action.isChecked()
        return "A recording is running. Closing ends it and keeps its file." if running else ""

    def can_close(self) -> bool:
        """Return True: closing loses nothing."""
        self.recorder.close()
        self.stream.close()
        self.views.keep()
        self.jobs.close()
        self.modes.close()
        self.live_depth.finish()
        self.views.stage.finish()
        return True

    def open_path(self, path: Path) -> None:
        """Use a folder of images or a recording as the camera."""
        if path.suffix == ENDING:
            self.context.source.choose_recording(path)
            return
        self.context.source.choose_folder(path)

    def show_stream(self) -> None:
        """Show what is sent to other programs."""
        self.stream.show_dialog()

    def begin_demo(self) -> None:
        """Show a coin that moves by itself on the virtual sensor."""
        self._use_virtual_sensor().play(coin_path)

    def begin_press(self) -> None:
        """Let the user choose the object on the virtual sensor."""
        bench = self._use_virtual_sensor()
        bench.stop()
        if bench.scene.depth_mm == 0.0:  # just lifted
            bench.place_object(bench.scene.item)
        self.views.bench_area.choose_item()

    def _use_virtual_sensor(self) -> VirtualBench:
        self.pause(False)
        bench = self.context.source.choose_virtual_sensor()
        use_virtual_calibration(self.jobs, context=self.context)
        self.views.bench.title.setChecked(True)
        return bench

    def export_actions(self) -> tuple[QAction, ...]:
        """Return what the File menu offers to export from this page."""
        files = self.file_actions
        return self.export.action, files.image_action, files.profile_action

    # The image

    def pause(self, on: bool) -> None:
        """Freeze the image, or continue."""
        self.pause_action.setChecked(on)
        self.pause_action.setText("Continue" if on else "Freeze")
        self.replay.hold(self._shown.frame if on and self._shown is not None else None)
        self.views.bench_area.hold(on)
        self.live.pause(on)
        self._want()
        self._advise()

    def _want(self) -> None:
        self.live_depth.request_results(
            replace(self.views.frame_request(), stream=self.stream.on, still=self.live.paused)
        )

    def _show(self, result: FrameResult) -> None:
        self._shown = result
        self.processed.show_steps(result.processed, result.refused)
        self.views.show_frame(result, still=self.live.paused)

    def _on_calibration(self) -> None:
        """Show the depth through another calibration, or none."""
        used = self.live_depth.live_reconstructor
        self.views.stage.use(None if used is None else used.calibration)
        self._forget()

    # Texts

    def _show_texts(self) -> None:
        self.modes.follow(self.live_depth.last)
        texts = self.stream.text, self.live_depth.rate_text()
        self._rate.setText("\n".join(filter(None, texts)))
        self._rate.setToolTip(plain_tip(self.live_depth.trace_text()))
        heightmap = None if self._shown is None else self._shown.heightmap
        reading = self.views.stage.reading
        self._value.setText(" " if reading is None else value_text(reading.depth_mm))
        text = "" if heightmap is None else "Point at a view to read the depth there."
        self._readout.setText(text if reading is None else reading.detail())

    # Advice

    def _on_source(self) -> None:
        self.recorder.stop()
        self._forget()

    def _on_switched(self) -> None:
        # The frozen image belongs to the closed stream and cannot be processed again.
        self.pause(False)
        bench = self.context.source.virtual
        if self.live.stream is not None and bench is not None and bench.is_untouched:
            bench.play(coin_path)
        self.views.follow_source()
        self.replay.follow(self.live.source)

    def _on_recorded(self, text: str, loses: bool) -> None:
        self._recorded.setText(text)
        self._recorded.setVisible(bool(text))
        set_text_role(self._recorded, "fail" if loses else "muted")

    def _on_stream(self) -> None:
        self._want()
        self._show_texts()

    def _advise(self) -> None:
        """Show what to do next."""
        state = self.live_depth.state
        idle = STORED if state.kind in ("folder", "recording") else LIVE
        self.banner.advise(advise(state), idle=FROZEN if self.live.paused else idle)

    def _forget(self) -> None:
        """Clear the depth, because it belongs to another calibration or source."""
        self._shown = None
        self.processed.show_steps((), "")
        self.views.forget()
