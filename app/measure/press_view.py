"""Measuring a press: the live or frozen image, the tools on it, and the results."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from PySide6.QtCore import Signal

from app.context.context import AppContext
from app.live.frame_results import Shown, Wanted
from app.live.zero import ZeroControl
from app.measure.advice import measuring_advice
from app.measure.judging import judge, record_of
from app.measure.measuring import MeasuredImage
from app.measure.press_view_frame import PressViewFrame
from app.measure.steady import SteadyPress
from app.services.file_dialogs import ask_open
from app.services.jobs import Jobs
from app.view2d.display import Display
from app.view3d.saving import ViewSaving
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.measurement.proposal import Proposal
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.recording import ENDING as RECORDING
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

IMAGES = (".png", ".tif", ".tiff")


class PressView(PressViewFrame):
    """Measures pressed objects.

    Parameters
    ----------
    jobs : Jobs
        For long work.
    context : AppContext
        Shared by all pages.

    Signals
    -------
    kept(object)
        A MeasurementRecord to be saved.
    """

    kept = Signal(object)

    def __init__(self, jobs: Jobs, *, context: AppContext) -> None:
        super().__init__(jobs, context=context)
        self.zero = ZeroControl(self.live, jobs, context=context)
        self._steady = SteadyPress()
        self.saving = ViewSaving(self.details.surface, self, settings=context.settings)
        self._best: Reconstructor | None = None
        self._shown: Shown | None = None
        self._refused = ""
        self._connect()
        self.restore()

    def _connect(self) -> None:
        self.freeze_pressed.connect(self.toggle_freeze)
        self.open_pressed.connect(self.choose_file)
        self.propose_pressed.connect(self.propose)
        self.keep_pressed.connect(self.keep)
        self.live.source_changed.connect(self._on_source)
        self.live.switched.connect(self._on_switched)
        self.depth.shown.connect(self._on_live)
        self.depth.calibration_loaded.connect(self._use)
        self.depth.changed.connect(self._advise)
        self.banner.act_wanted.connect(self._on_act)
        self.work.changed.connect(self._refresh)
        self.work.image_changed.connect(self._refresh)
        self.map.drawn.connect(self.details.show_tools)
        self.details.wanted_changed.connect(self._want)
        self.saving.reported.connect(self.context.toasts.show)
        self.replay.moved.connect(self._on_replayed)
        self.work.busy_changed.connect(self._advise)
        self.work.refused.connect(self._on_refused)
        self.work.proposed.connect(self._on_proposed)
        self.map.freeze_wanted.connect(lambda: self.freeze(True))
        self.map.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        panel = self.panel
        panel.propose.clicked.connect(self.propose)
        panel.tool_chosen.connect(self.work.choose)
        panel.remove.clicked.connect(lambda: self.work.remove(self.work.chosen))
        panel.keep.clicked.connect(self.keep)
        panel.truth.changed.connect(self.judge_again)

    # Called by the page

    @property
    def calibration(self) -> Calibration | None:
        """The calibration used for measuring. None if there is none."""
        return None if self._best is None else self._best.calibration

    def enter(self) -> None:
        """Show the source through the calibration in use."""
        self._want()
        self.depth.enter()
        self._refresh()

    def leave(self) -> None:
        """Release the source. A frozen image stays."""
        self.keep_layout()
        self.live.enter(False)

    def close_work(self) -> None:
        """End every thread. Those of the reconstructors end with them."""
        self.work.close()
        self._best = self._shown = None
        self.depth.finish()
        self.details.finish()

    def _want(self) -> None:
        """Compute from live frames only what is visible."""
        details = self.details
        self.depth.want(
            Wanted(height=True, surface=details.wants_surface, camera=details.wants_camera)
        )

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
        if path.suffix.lower() not in IMAGES:
            raise InputError(
                tr("The file is neither an image nor a recording"),
                where=path,
                advice=Remedy.CHOOSE_IMAGES,
            )
        self.context.settings.keep_folder("press", path.parent)
        self._take(MeasuredImage(path.name, path=path))

    def choose_file(self) -> None:
        """Let the user choose an image or a recording."""
        endings = " ".join(f"*{ending}" for ending in (*IMAGES, RECORDING))
        chosen = ask_open(
            self,
            self.context.settings,
            "press",
            tr("Open an image or a recording"),
            tr("Images and recordings ({endings})").format(endings=endings),
        )
        if chosen is not None:
            with self.context.toasts.errors():
                self.open_file(chosen)

    # Live and frozen

    def toggle_freeze(self) -> None:
        """Freeze the image, or continue."""
        (self.freeze if self.work.image is None else self.release)()

    def freeze(self, by_hand: bool = True) -> None:
        """Freeze the shown image to measure on it."""
        shown = self._shown
        if self.work.image is None and shown is not None:
            now = datetime.now().astimezone()
            info = self.context.source.info
            camera = tr("image") if info is None else info.name
            name = tr("{camera}, {time:%H:%M:%S}").format(camera=camera, time=now)
            image = MeasuredImage(name, frame=shown.frame, serial=self.live.serial)
            self._take(image, propose=not by_hand)
        self._follow_freeze()

    def release(self) -> None:
        """Continue with the live image."""
        self._steady.hold_off()
        self.work.take(None)
        self.live.pause(False)
        self._follow_freeze()
        if self.live.stream is None or not self.map.view.has_image:
            self._say_what_comes()

    def _take(self, image: MeasuredImage, *, propose: bool = False) -> None:
        self.live.pause(True)
        self._refused = ""
        self.panel.say_kept("")
        self.panel.truth.new_press()
        self.work.take(image, propose=propose)
        if image.path is not None:
            self._say_what_comes()
        self._follow_freeze()

    def _say_what_comes(self) -> None:
        """Show a text instead of the map."""
        image = self.work.image
        if image is None or self._best is None:
            self.map.say(tr("No depth yet."))
        else:
            self.map.say(tr("Reconstructing {name}…").format(name=image.name))

    def _follow_freeze(self) -> None:
        frozen = self.work.image is not None
        self.freeze_action.setChecked(frozen)
        self.freeze_action.setText(tr("Frozen") if frozen else tr("Freeze"))
        self._refresh()

    def _on_live(self, shown: Shown) -> None:
        if self.work.image is not None:
            return
        self.map.show_live(shown, Display())
        self.details.show_live(shown)
        heightmap = shown.heightmap
        before, self._shown = self._shown, None if heightmap is None else shown
        if (before is None) != (heightmap is None):
            self._refresh()
        if heightmap is None:
            return
        frame = shown.frame
        steady = self._steady.update(heightmap.depth_mm, frame.time_s, settled=frame.settled)
        if steady and self.auto.isChecked():
            self.freeze(by_hand=False)

    # Measuring

    def propose(self) -> None:
        """Detect the pressed object."""
        if self.work.image is None:
            self.freeze(by_hand=False)
        else:
            self.work.propose()

    def keep(self) -> None:
        """Save the result of the chosen tool to the records."""
        result, heightmap = self.work.result, self.work.heightmap
        best = self._best
        if result is None or heightmap is None or best is None:
            return
        record = record_of(
            result,
            self.panel.truth.stated,
            heightmap,
            limits=self.context.settings.limits,
            serial=best.calibration.serial,
            operator=self.panel.operator.text().strip(),
            note=self.panel.note.text().strip(),
        )
        self.kept.emit(record)

    def judge_again(self) -> None:
        """Compare with the true values again after they, the result or the limits changed."""
        truth, result = self.panel.truth, self.work.result
        if result is None:
            truth.say("")
            return
        try:
            truth.show_verdict(judge(result, truth.stated, self.context.settings.limits))
        except InputError as error:
            truth.say(str(error), "fail")

    def _refresh(self) -> None:
        can_freeze = self._shown is not None
        known = self.work.heightmap is not None or can_freeze
        self.panel.show_work(self.work, known=known)
        self.details.show_results(self.work.image_results)
        self.details.show_result(self.work.tool, self.work.result)
        self.map.tools.setEnabled(known)
        self.freeze_action.setEnabled(self.work.image is not None or can_freeze)
        self.judge_again()
        self._advise()

    def _on_switched(self) -> None:
        self.replay.follow(self.live.source)
        self.follow_bench()

    def _on_replayed(self) -> None:
        """Show another frame of the recording instead of the frozen one."""
        if self.work.image is not None:
            self.release()

    def _on_proposed(self, proposal: Proposal | None) -> None:
        if proposal is None:
            text = tr("No ball, cylinder or cuboid was found. Press one, or use the other tools.")
            self.context.toasts.show(text)
        elif len(proposal.candidates) > 1:
            names = tr(" and ").join(proposal.candidates)
            text = tr(
                "The object is not unique: {names} fit equally well. Choose the correct tool."
            )
            self.context.toasts.show(text.format(names=names), "warn")

    def _on_refused(self, sentence: str) -> None:
        self._refused = sentence
        self.map.say(tr("This image cannot be measured."))
        self._advise()

    # The calibration and the source

    def _use(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Measure with another calibration. Live only if it fits the images."""
        self._best = best
        self._refused, self._shown = "", None
        # Before the tools are redrawn: it gives their position in the camera image.
        self.details.use(None if best is None else best.calibration)
        self.work.use(best)
        self._say_what_comes()
        self.depth.choose(live, best)
        self._refresh()

    def _on_source(self) -> None:
        self._shown = None
        if self.work.image is None:
            self.map.say(tr("No depth yet."))

    # Advice

    def _advise(self) -> None:
        """Show what to do next."""
        frozen = self.work.image is not None
        heightmap = self.work.heightmap if frozen else None
        findings = () if heightmap is None else heightmap.findings
        self.banner.advise(
            measuring_advice(
                self.depth.state, frozen=frozen, refused=self._refused, findings=findings
            )
        )

    def _on_act(self, name: str) -> None:
        match name:
            case "live":
                self.release()
            case "zero":
                self.zero.set_zero()
            case _:
                self.depth.act(name)
