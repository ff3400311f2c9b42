"""Measuring a press: the live or frozen image, the tools on it, and the results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from app.live.banner import AdviceBanner
from app.live.frame_processor import FrameRequest, FrameResult
from app.live.frame_viewer import FrameViewer, ViewLayout
from app.live.live_depth import LiveDepth
from app.live.live_session import LiveSession
from app.live.replay_bar import ReplayBar
from app.live.tool_layer import tool_handles
from app.program.context import AppContext
from app.program.file_dialogs import ask_open, ask_save
from app.program.jobs import BackgroundJob, JobQueue
from app.program.workspace import folder_name
from app.source_ui.bench_panel import BenchArea
from app.sources.source_list import next_image
from app.views.map.colour_tables import colour_table
from app.widgets.actions import Slot, action_button, icon_button, make_action, undo_actions
from app.widgets.inputs import refusal
from app.widgets.label import plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.membrane_shape import FLAT
from gelpolight_core.image.image_file import SUFFIXES
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.measurement.result import MeasuredPress, Measurement
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.file_hashes import file_hash

from .indenter_mesh import solid_of
from .inspector import Inspector
from .measurement_engine import MeasuredImage, with_residual
from .measurement_model import MeasurementModel
from .press_state import PressState, advice_of, resolve_press
from .reference_comparison import record_of
from .steady_press import SteadyPressDetector
from .tool_map import ToolList, ToolMap, ToolPalette, ToolSection

TOOLS_WIDTH = 148
QUANTITIES = {"depth": "Depth", "residual": "Residual of the fitted object"}
"""What colours the surface in 3D."""
CERTIFY_TIPS = (
    "Measure a ball, cylinder or cuboid first",
    "Save the sizes with their uncertainty budget and decisions as PDF",
    "Open the record's image first",
)
"""Of the certificate: why there is none, what it is, and why there is none beside the records."""


class PressView(QWidget):
    """Measures objects in a live or frozen image: tools, results and references.

    Parameters
    ----------
    jobs : JobQueue
        For long work.
    on_save : callable
        Called with a MeasurementRecord to be saved.
    is_saved : callable
        Returns whether the records hold the measurement of a MeasurementRecord.
    on_edit, on_records : callable
        Called to edit the known objects, and to show the records.
    context : AppContext
        Shared by all pages.

    Attributes
    ----------
    state : PressState
        What is shown.
    """

    def __init__(
        self,
        jobs: JobQueue,
        *,
        on_save: Callable[[MeasurementRecord], object],
        is_saved: Callable[[MeasurementRecord], bool],
        on_edit: Slot,
        on_records: Slot,
        context: AppContext,
    ) -> None:
        super().__init__()
        set_names(self, "measure.press", "Measure a press")
        self.context, self._jobs = context, jobs
        self._on_save, self._is_saved = on_save, is_saved
        self._answer = ""
        self.work = MeasurementModel(self)
        self.live = LiveSession(context=context, name="measure live", parent=self)
        self.live_depth = LiveDepth(self.live, jobs, self, context=context)
        self._steady = SteadyPressDetector()
        self._best: Reconstructor | None = None
        self._shown: FrameResult | None = None
        self._frozen: FrameResult | None = None
        self._measurement: Measurement | None = None
        self._colour_by = "depth"
        self.map = ToolMap(self.work, self._on_placed)
        self.section = ToolSection()
        self.stage = FrameViewer(
            "measure",
            jobs,
            self.map,
            self.section,
            on_arranged=self._on_arranged,
            on_pointed=lambda: self.map.show_reading(self.stage.reading),
            context=context,
        )
        colours, menu = "Colour by", self.stage.surface.menu
        menu.add_choices(colours, "colour", QUANTITIES, self._on_colour, self._colour_by)
        self.palette_ = ToolPalette(self, self._place)
        self._make_actions()
        self._bench = BenchArea(context.source)
        self.inspector = Inspector(
            self.freeze_action,
            self.save_action,
            self._bench,
            on_reference=self.refresh,
            on_edit=on_edit,
            on_records=on_records,
        )
        idle = "Place a tool, or detect the object. Press Space for the next object."
        self.banner = AdviceBanner(jobs, idle=idle, on_act=self._on_act, over=self.stage.parts)
        self.replay = ReplayBar("measure", self._on_replayed)
        self._lay_out()
        self._connect()
        self.state = self._resolved()
        self.stage.arrange(ViewLayout("height", section=False))
        self.refresh()

    def _make_actions(self) -> None:
        add, tip = partial(make_action, self), "Detect the pressed object"
        self.detect_action = add(
            "measure.propose", "Detect", self.propose, keys=("Q",), icon_name="propose", tip=tip
        )
        tip = "Freeze the image to measure on it, or continue"
        self.freeze_action = add(
            "measure.hold", "Freeze", self.toggle_freeze, keys=("Space",), tip=tip
        )
        self.save_action = add("measure.keep", "Save to records", self.keep, keys=("Ctrl+Return",))
        self.certify_action = add("measure.certify", "Certificate…", self.choose_certificate)
        tip, remove = "Remove the chosen tool (Del)", self.work.remove
        self.remove_action = add("measure.remove", "Remove", remove, icon_name="remove", tip=tip)
        add("measure.fit", "Whole map", self.map.map.fit, keys=("F",))
        name, text, tip = "measure.open", "Open image…", "Measure on an image from a file"
        file = add(name, text, self.choose_file, keys=("Ctrl+P",), icon_name="folder", tip=tip)
        for action in (*undo_actions(self, "measure", self.work.undo), file):
            self.stage.bar.addWidget(icon_button(action))

    def _lay_out(self) -> None:
        self.placed = ToolList(self.work)
        tools = QWidget()
        tools.setFixedWidth(TOOLS_WIDTH)
        vbox(
            action_button(self.detect_action),
            self.palette_,
            (self.placed, 1),
            action_button(self.remove_action),
            of=tools,
            margins=(8, 8, 4, 8),
            spacing=6,
        )
        column = vbox(self.banner, (self.stage, 1), self.replay, margins=0, spacing=0)
        hbox(tools, (column, 70), (self.inspector, 30), of=self, margins=0, spacing=0)

    def _connect(self) -> None:
        self.live.source_changed.connect(self._on_source)
        self.live.switched.connect(self._on_switched)
        self.live_depth.shown.connect(self._on_live)
        self.live_depth.calibration_loaded.connect(self._use)
        self.live_depth.changed.connect(self._advise)
        self.work.changed.connect(self.refresh)
        self.context.display.changed.connect(self._on_display)
        self.work.show_as(self.context.display.value)

    # Called by the page

    def enter(self) -> None:
        """Show the source through the calibration in use."""
        self._want()
        self.live_depth.enter()
        self.refresh()

    def leave(self) -> None:
        """Release the source. A frozen image stays."""
        self.live.enter(False)

    def close_work(self) -> None:
        """End every thread. Those of the reconstructors end with them."""
        self.work.close()
        self._best = self._shown = None
        self.live_depth.finish()
        self.stage.finish()

    def open_file(self, path: Path) -> None:
        """Measure on an image, or play a recording as the camera.

        Raises
        ------
        InputError
            If it is neither.
        """
        if path.suffix.lower() == RECORDING:
            self.context.source.choose_recording(path)
            self.release()
            return
        if path.suffix.lower() not in SUFFIXES:
            raise InputError(
                "The file is neither an image nor a recording", path, Remedy.CHOOSE_IMAGES
            )
        self.context.settings.keep_folder("press", path.parent)
        self._take(MeasuredImage(path.name, path=path))

    def choose_file(self) -> None:
        """Let the user choose an image or a recording."""
        endings = " ".join(f"*{ending}" for ending in (*SUFFIXES, RECORDING))
        title, patterns = "Open an image or a recording", f"Images and recordings ({endings})"
        if path := ask_open(self, self.context.settings, "press", title, patterns):
            self.try_file(path)

    def try_file(self, path: Path) -> None:
        """Measure on an image or play a recording, or show why that is not possible."""
        try:
            self.open_file(path)
        except InputError as error:
            self.inspector.show_message(str(error), "fail")

    # Live and frozen

    def toggle_freeze(self) -> None:
        """Freeze the image, or go to the next object: the next file of a folder, or live."""
        image = self.work.image
        if image is None:
            self.freeze()
            return
        following = None if image.path is None else next_image(image.path)
        if following is not None:
            self.try_file(following)
        elif image.path is not None or not self.replay.step(1):
            self.release()

    def freeze(self, *, propose: bool = False) -> None:
        """Freeze the newest live image to measure on it, and detect the object if requested."""
        if (newest := self._shown) is None:
            return
        now = datetime.now().astimezone()
        info = self.context.source.info
        camera = "image" if info is None else info.name
        name = newest.frame.name or f"{camera}, {now:%H:%M:%S}"
        self.replay.hold(newest.frame)
        image = MeasuredImage(name, frame=newest.frame, serial=self.live.serial)
        self._take(image, propose=propose)

    def release(self) -> None:
        """Continue with the live image."""
        if self.work.image is not None and self.work.image.path is not None:
            self.stage.surface.set_pins(())  # they were on another source's image
        self._steady.hold(None)
        self.work.take(None)
        self._on_switched()
        self.replay.hold(None)
        self._want()
        if self.live.stream is None or not self.map.map.has_image:
            self._say_what_comes()

    def begin(self) -> None:
        """Measure the object on the sensor as soon as it is steady."""
        self.release()
        self._steady.restart()

    def _take(self, image: MeasuredImage, *, propose: bool = False) -> None:
        self._steady.hold(image.frame)
        self.inspector.show_message("")
        bench = None if image.frame is None else self.context.source.virtual
        self.inspector.reference.new_press(None if bench is None else bench.scene.truth)
        self.work.take(image, propose=propose)
        self._on_switched()
        self._want()
        if image.path is not None:
            self._say_what_comes()

    def _want(self) -> None:
        """Compute from live frames only what is needed, and nothing beside the measurement."""
        image = self.work.image
        self.live.pause(image is not None and (image.path is not None or self.work.busy))
        live, shows = image is None, self.stage.shows
        self.live_depth.request_results(
            FrameRequest(
                height=True,
                surface=live and shows("surface"),
                camera=live and shows("camera"),
                display=replace(self.context.display.value, colour_by="depth"),
            )
        )

    def _on_display(self) -> None:
        self.work.show_as(self.context.display.value)
        self._want()

    def _on_arranged(self) -> None:
        self._want()
        self._show_frozen()

    def _say_what_comes(self) -> None:
        """Show a text instead of the map."""
        image = self.work.image
        if image is None or self._best is None:
            self.stage.show_message("No depth yet.")
        else:
            self.stage.show_message(f"Reconstructing {image.name}…")

    def _on_live(self, shown: FrameResult) -> None:
        image, heightmap = self.work.image, shown.heightmap
        if image is None:
            self.stage.show_frame(shown)
        elif image.frame is None or self.work.busy:
            return
        before, self._shown = self._shown, None if heightmap is None else shown
        earlier = self._steady.other
        if heightmap is not None and (
            self._steady.update(shown.frame, heightmap)
            and self.inspector.auto.isChecked()
            and (image is None or (self._steady.other and not self.work.placed_by_hand))
        ):
            self.freeze(propose=True)
        elif (before is None) != (heightmap is None) or earlier != self._steady.other:
            self.refresh()

    # Measuring

    def propose(self) -> None:
        """Detect the object that is pressed in now."""
        if self.work.image is None or self.state.earlier:
            self.freeze(propose=True)
        else:
            self.work.propose()

    def keep(self) -> None:
        """Save the result of the chosen tool to the records."""
        if fault := refusal(self.inspector.reference):
            self.context.toasts.show(fault, "warn")
        elif (record := self._record()) is not None:
            self._on_save(record)

    def _record(self) -> MeasurementRecord | None:
        """Return the record of the chosen tool's result. None: there is no result."""
        image, result, heightmap = self.work.image, self.work.result, self.work.heightmap
        if image is None or result is None or heightmap is None or self._best is None:
            return None
        return record_of(
            result,
            self.inspector.reference.stated_for(result.tool.name),
            heightmap,
            limits=self.context.settings.limits,
            serial=self._best.calibration.serial,
            operator=self.inspector.remarks.value.operator.strip(),
            note=self.inspector.remarks.value.note.strip(),
            file=image.path,
        )

    def certificate_action(self, *, shown: bool) -> QAction:
        """Return the action that writes the certificate of the measured object, if it is shown."""
        can_certify = self._measurement is not None and shown
        self.certify_action.setEnabled(can_certify)
        self.certify_action.setToolTip(plain_tip(CERTIFY_TIPS[can_certify if shown else 2]))
        return self.certify_action

    def choose_certificate(self) -> None:
        """Let the user choose the file of the certificate of the measured object."""
        assert self.work.image is not None, "the action is only for a measurement"
        stem = folder_name(Path(self.work.image.name).stem)
        title, name = "Save the certificate", f"{stem}-certificate.pdf"
        if path := ask_save(self, self.context.settings, "report", title, name, "PDF (*.pdf)"):
            self.certify(path)

    def certify(self, path: Path) -> None:
        """Write the certificate of the measured object. A message says where it is."""
        image, heightmap, fit = self.work.image, self.work.heightmap, self._measurement
        if image is None or heightmap is None or fit is None or self._best is None:
            return
        calibration = self._best.calibration
        digest = "" if image.path is None else file_hash(image.path)
        truth = self.inspector.reference.stated_for(fit.shape)
        press = MeasuredPress(image.name, digest, heightmap, fit, truth, image.time)
        percent = self.context.settings.limits.percent
        operator = self.inspector.remarks.value.operator
        colours = colour_table(self.context.display.value.colours)

        def write(_progress: object) -> None:
            from gelpolight_core.output.report.certificate import measurement_report
            from gelpolight_core.output.report.report_pdf_file import write_report  # slow to import

            report = measurement_report(
                calibration, (press,), limits_percent=percent, operator=operator, colours=colours
            )
            write_report(report, path)

        def done(_nothing: None) -> None:
            self.context.toasts.show(f"Certificate saved to {path}.", "pass")

        self._jobs.submit(BackgroundJob("Writing the certificate", write, done, must=True))

    def _place(self, kind: str) -> None:
        """Let the user place a tool on the frozen image. Empty: none."""
        if kind and not self.state.measurable:
            self.palette_.clear()
            return
        if kind:
            self.stage.arrange(replace(self.stage.arranged, stage="height"))
            if self.work.image is None:
                self.freeze()
        self.map.place(kind)

    def _on_placed(self, problem: str) -> None:
        self.palette_.clear()
        self.inspector.show_message(problem, "warn")

    # What is shown

    def _resolved(self) -> PressState:
        tool = self.work.tool
        return resolve_press(
            self.work,
            self.inspector.reference.stated_for("" if tool is None else tool.name),
            self.context.settings.limits,
            freezable=self._shown is not None,
            earlier=self.work.image is not None and self._steady.other,
        )

    def unfinished(self) -> str:
        """Return what would be lost if the window was closed. Empty: nothing."""
        unsaved = self.save_action.isEnabled()
        return "A measurement is not saved to the records." if unsaved else ""

    def refresh(self) -> None:
        """Show the present state, of an object with the edge that is stated."""
        tool, stated_for = self.work.tool, self.inspector.reference.stated_for
        if tool is not None:
            self.work.state_edge(*stated_for(tool.name).edge_mm)
        state = self.state = self._resolved()
        self._want()
        self._show_work()
        if self.work.refused:
            self.stage.show_message("This image cannot be measured.")
        self.inspector.show_state(state)
        if self.work.answer != self._answer:  # that of the image before is cleared
            self._answer = self.work.answer
            self.inspector.show_message(self._answer, "warn")
        self.palette_.setEnabled(state.measurable)
        self.detect_action.setEnabled(state.measurable and not state.detecting)
        self.detect_action.setText("Detecting…" if state.detecting else "Detect")
        self.freeze_action.setEnabled(state.frozen or state.freezable)
        self.freeze_action.setText("Next object" if state.frozen else "Freeze")
        record = self._record()
        saved = record is not None and self._is_saved(record)
        self.save_action.setEnabled(record is not None and not saved)
        text = "Save the earlier press" if state.earlier else "Save to records"
        self.save_action.setText("Saved" if saved else text)
        self.remove_action.setEnabled(bool(state.kind))
        if not state.frozen:
            self.palette_.clear()
        self.placed.refresh()
        self._advise()

    def _show_work(self) -> None:
        """Show the frozen image, its tools and their section."""
        work, results = self.work, self.work.image_results
        grips = () if work.tool is None or work.refused else tool_handles(work.tool)
        self.stage.show_tools(self.map.drawn(), grips, work.grip)
        self.section.show_work(work)
        before = self._frozen, self._measurement
        self._frozen = None if results is None else results.shown
        fit = self._measurement = None if work.result is None else work.result.measurement
        if fit is not before[1]:
            at_rest = FLAT if work.heightmap is None else work.heightmap.at_rest
            self.stage.surface.show_solid(None if fit is None else partial(solid_of, fit, at_rest))
        if self._frozen is not before[0] or (
            fit is not before[1] and self._colour_by == "residual"
        ):
            self._show_frozen()

    def _show_frozen(self) -> None:
        """Show the frozen image in the visible views."""
        if (image := self._frozen) is not None:
            if self._colour_by == "residual":
                image = with_residual(image, self._measurement)
            self.stage.show_frame(image, still=True)

    def _on_colour(self, quantity: str) -> None:
        self._colour_by = quantity
        self._show_frozen()

    def _advise(self) -> None:
        """Show what to do next."""
        heightmap = self.work.heightmap
        findings = () if heightmap is None else heightmap.findings
        self.banner.advise(
            advice_of(
                self.live_depth.state, self.state, refused=self.work.refused, findings=findings
            )
        )

    def _on_act(self, name: str) -> None:
        if name == "live":
            self.release()
        else:
            self.live_depth.act(name)

    # The calibration and the source

    def _on_switched(self) -> None:
        image = self.work.image
        is_opened = image is not None and image.path is not None
        self.replay.follow(None if is_opened else self.live.source)
        self.inspector.bench.setVisible(self._bench.follow())

    def _on_replayed(self) -> None:
        """Show another frame of the recording instead of the frozen one."""
        if self.work.image is not None:
            self.release()

    def _use(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Measure with another calibration. Live only if it fits the images."""
        self._best, self._shown = best, None
        # Before the tools are redrawn: it gives their position in the camera image.
        self.stage.use(None if best is None else best.calibration)
        self._say_what_comes()
        self.work.use(best)
        self.live_depth.choose(live, best)

    def _on_source(self) -> None:
        self._shown = None
        self._steady.restart()
        self.stage.surface.set_pins(())
        if self.work.image is None:
            self.stage.show_message("No depth yet.")
