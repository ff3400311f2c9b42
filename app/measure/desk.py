"""Where a press is measured: the picture live or held, tools on it, and what is known of them."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QFileDialog,
)

from app.inspect.advice import Situation
from app.inspect.drift_watch import DriftWatch
from app.inspect.link import LiveLink
from app.inspect.look import Look
from app.inspect.products import Shown, Wanted
from app.inspect.situation import situation_of
from app.measure.advice import measuring_advice
from app.measure.desk_frame import DeskFrame
from app.measure.judging import Judged, judge
from app.measure.keeping import Kept
from app.measure.measuring import Taken
from app.measure.steady import SteadyPress
from app.shell.context import AppContext
from app.shell.jobs import Jobs
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.proposal import Proposal
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.recording import ENDING as RECORDING
from gelpolight_core.translation import tr

PICTURES = (".png", ".tif", ".tiff")


class Desk(DeskFrame):
    """Measures what is pressed.

    Parameters
    ----------
    jobs : Jobs
        For long work.
    context : AppContext
        The program's.

    Signals
    -------
    kept(object)
        A result (Kept) shall go to the records.
    calibrate_wanted(), indenters_wanted(), limits_wanted()
        The virtual sensor shall be calibrated, a list or the limits be edited.
    """

    kept = Signal(object)
    calibrate_wanted = Signal()
    indenters_wanted = Signal()
    limits_wanted = Signal()

    def __init__(self, jobs: Jobs, *, context: AppContext) -> None:
        super().__init__(jobs, context=context)
        self.link = LiveLink(self._on_live, context=context, parent=self)
        self._steady = SteadyPress()
        self.drift = DriftWatch(jobs, self)
        self._loaded: tuple[Reconstructor | None, Reconstructor | None] = (None, None)
        self._size: tuple[int, int] | None = None
        self._shown: Shown | None = None
        self._trouble = self._refused = ""
        self._connect()
        # Where work has ended, it may have come to nothing.
        jobs.progressed.connect(lambda title, _share: title or self._advise())
        self.restore()

    def _connect(self) -> None:
        self.hold_pressed.connect(self.toggle_hold)
        self.open_pressed.connect(self.choose_file)
        self.propose_pressed.connect(self.propose)
        self.keep_pressed.connect(self.keep)
        self.calibrations.loaded.connect(self._use)
        self.context.source.changed.connect(self._on_source)
        self.link.said.connect(self._on_said)
        self.drift.said.connect(self._on_drift)
        self.banner.act_wanted.connect(self._on_act)
        self.work.changed.connect(self._refresh)
        self.work.picture_changed.connect(self._refresh)
        self.map.drawn.connect(self.details.show_tools)
        self.details.wanted_changed.connect(self._want)
        self.link.switched.connect(self._on_switched)
        self.replay.moved.connect(self._on_replayed)
        self.work.busy_changed.connect(self._advise)
        self.work.refused.connect(self._on_refused)
        self.work.proposed.connect(self._on_proposed)
        self.map.hold_wanted.connect(lambda: self.hold(True))
        self.map.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        panel = self.panel
        panel.propose_wanted.connect(self.propose)
        panel.tool_chosen.connect(self.work.choose)
        panel.remove_wanted.connect(lambda: self.work.remove(self.work.chosen))
        panel.keep_wanted.connect(self.keep)
        panel.truth.changed.connect(self.judge_again)
        panel.truth.indenters_wanted.connect(self.indenters_wanted)
        panel.truth.limits_wanted.connect(self.limits_wanted)

    # What the page asks

    @property
    def calibration(self) -> Calibration | None:
        """The calibration that is measured with; None where there is none."""
        best = self._loaded[1]
        return None if best is None else best.calibration

    def enter(self) -> None:
        """Look at the source through the calibration in use."""
        self.calibrations.refresh()
        self.calibrations.refer_cameras(self._loaded[0])
        self.show_validated()
        self._want()
        self.link.enter(True)
        self.follow_bench()
        self._refresh()

    def leave(self) -> None:
        """Let the source go; a picture that is held stays."""
        self.keep_layout()
        self.link.enter(False)

    def close_work(self) -> None:
        """End every thread, those of the reconstructors, too: they go with them."""
        self.link.enter(False)
        self.work.close()
        self.link.use(None)
        self._loaded, self._shown = (None, None), None
        self.details.finish()

    def _want(self) -> None:
        """Have made of live frames what is in sight."""
        details = self.details
        self.link.want(
            Wanted(height=True, surface=details.wants_surface, camera=details.wants_camera)
        )

    def open_file(self, path: Path) -> None:
        """Measure on a picture, or play a recording as the camera.

        Raises
        ------
        InputError
            If it is neither.
        """
        if path.suffix.lower() == RECORDING:
            self.context.source.choose_recording(path)
            self.release()
            return
        if path.suffix.lower() not in PICTURES:
            raise InputError(
                tr("this is neither a picture nor a recording"),
                where=str(path),
                advice=tr("Open a PNG or TIFF picture of the calibrated sensor"),
            )
        self.context.settings.last_folder = path.parent
        self._take(Taken(path.name, path=path))

    def choose_file(self) -> None:
        """Let the person choose a picture or a recording."""
        endings = " ".join(f"*{ending}" for ending in (*PICTURES, RECORDING))
        chosen, _ = QFileDialog.getOpenFileName(
            self,
            tr("Open a picture or a recording"),
            str(self.context.settings.last_folder),
            tr("Pictures and recordings ({endings})").format(endings=endings),
        )
        if chosen:
            self._try_file(Path(chosen))

    def _try_file(self, path: Path) -> None:
        try:
            self.open_file(path)
        except InputError as error:
            self.context.toasts.show(str(error), "fail")

    # Live and held

    def toggle_hold(self) -> None:
        """Hold the picture, or go on."""
        if self.work.taken is None:
            self.hold()
        else:
            self.release()

    def hold(self, by_hand: bool = True) -> None:
        """Hold the picture that is shown, to measure on it."""
        shown = self._shown
        if self.work.taken is None and shown is not None:
            now = datetime.now().astimezone()
            name = tr("{camera}, {time:%H:%M:%S}").format(camera=self._camera(), time=now)
            taken = Taken(name, frame=shown.frame, serial=self.link.serial)
            self._take(taken, propose=not by_hand)
        self._follow_hold()

    def release(self) -> None:
        """Go on with the live picture."""
        self._steady.hold_off()
        self.work.take(None)
        self.link.pause(False)
        self._follow_hold()
        if self.link.stream is None or not self.map.view.has_picture:
            self._say_what_comes()

    def _take(self, taken: Taken, *, propose: bool = False) -> None:
        self.link.pause(True)
        self._refused = ""
        self.panel.say_kept("")
        self.work.take(taken, propose=propose)
        if taken.path is not None:
            self._say_what_comes()
        self._follow_hold()

    def _say_what_comes(self) -> None:
        """Put words in the place of the map."""
        taken = self.work.taken
        if taken is None or self._loaded[1] is None:
            self.map.say(tr("No depth yet."))
        else:
            self.map.say(tr("Reconstructing {name}…").format(name=taken.name))

    def _follow_hold(self) -> None:
        held = self.work.taken is not None
        self.hold_action.setChecked(held)
        self.hold_action.setText(tr("Held") if held else tr("Hold"))
        self._refresh()

    def _on_live(self, shown: Shown) -> None:
        rows, columns = shown.frame.rgb.shape[:2]
        if self._size != (columns, rows):
            self._size = columns, rows
            self._advise()
        if self.work.taken is not None:
            return
        self.map.show_live(shown, Look())
        self.details.show_live(shown)
        heightmap = shown.heightmap
        could, self._shown = self._can_hold, None if heightmap is None else shown
        if could != self._can_hold:
            self._refresh()
        if heightmap is None:
            return
        self.drift.look(shown, self.link.reconstructor)
        frame = shown.frame
        steady = self._steady.update(heightmap.depth_mm, frame.time_s, settled=frame.settled)
        if steady and self.auto.isChecked():
            self.hold(by_hand=False)

    def _camera(self) -> str:
        info = self.context.source.info
        return tr("picture") if info is None else info.name

    # Measuring

    def propose(self) -> None:
        """Say what is pressed."""
        if self.work.taken is None:
            self.hold(by_hand=False)
        else:
            self.work.propose()

    def keep(self) -> None:
        """Send the chosen tool's result to the records."""
        result, heightmap = self.work.result, self.work.heightmap
        best = self._loaded[1]
        if result is None or heightmap is None or best is None:
            return
        kept = Kept(
            result=result,
            judged=self.judged(),
            stated=self.panel.truth.stated,
            limits=self.context.settings.limits,
            heightmap=heightmap,
            serial=best.calibration.sensor.serial,
            operator=self.panel.who.text().strip(),
            note=self.panel.note.text().strip(),
        )
        self.kept.emit(kept)

    def judged(self) -> tuple[Judged, ...]:
        """Return how the chosen tool's result compares with what is stated."""
        result = self.work.result
        if result is None:
            return ()
        return judge(result, self.panel.truth.stated, self.context.settings.limits)

    def judge_again(self) -> None:
        """Compare with the truth again: it, the result or the limits are others."""
        try:
            rows = self.judged()
        except InputError as error:
            self.panel.truth.show_refusal(str(error))
            return
        self.panel.truth.show_verdict(rows, self.work.result)

    def _refresh(self) -> None:
        known = self.work.heightmap is not None or self._can_hold
        self.panel.show_work(self.work, known=known)
        self._show_details()
        self.map.tools.allow(known)
        self.hold_action.setEnabled(self.work.taken is not None or self._can_hold)
        self.judge_again()
        self._advise()

    def _show_details(self) -> None:
        self.details.show_answer(self.work.answer)
        self.details.show_result(self.work.tool, self.work.result)

    def _on_switched(self) -> None:
        self.replay.follow(None if self.link.stream is None else self.link.stream.source)

    def _on_replayed(self) -> None:
        """Let another frame of the recording be seen; the one that is held gives way."""
        if self.work.taken is not None:
            self.release()

    @property
    def _can_hold(self) -> bool:
        return self._shown is not None

    def _on_proposed(self, proposal: Proposal | None) -> None:
        if proposal is None:
            text = tr("No ball, cylinder or cuboid was found: press one, or use the other tools.")
            self.context.toasts.show(text)
        elif len(proposal.candidates) > 1:
            names = tr(" and ").join(proposal.candidates)
            text = tr("Not clear which: {names} fit alike. Choose the tool that is right.")
            self.context.toasts.show(text.format(names=names), "warn")

    def _on_refused(self, sentence: str) -> None:
        self._refused = sentence
        self.map.say(tr("This picture cannot be measured on."))
        self._advise()

    # The calibration and the source

    def _use(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Measure with another calibration; live only where it belongs to the pictures."""
        self._loaded = live, best
        if self.isVisible():
            self.calibrations.refer_cameras(live)
        self._refused, self._shown = "", None
        self.drift.again()
        self.link.use(None)
        # Before the tools are drawn again: it says where in the camera's picture they are.
        self.details.use(None if best is None else best.calibration)
        self.work.use(best)
        self._say_what_comes()
        self.show_validated()
        self._refresh()

    def _on_source(self) -> None:
        self._shown = self._size = None
        self.drift.again()
        self.link.open()
        self.follow_bench()
        if self.work.taken is None:
            self.map.say(tr("No depth yet."))
        self._advise()

    # What to do next

    def _on_said(self, sentence: str) -> None:
        if self._trouble and not sentence:
            self.drift.again()
        self._trouble = sentence
        self._advise()

    def _on_drift(self, sentence: str) -> None:
        if sentence:
            self.context.toasts.show(sentence, "warn")

    def _situation(self) -> Situation:
        return situation_of(
            self.link, self.calibrations, self._loaded[0], context=self.context,
            size=self._size, trouble=self._trouble,
        )  # fmt: skip

    def _advise(self) -> None:
        """Say what to do next, and look through the calibration only where it fits."""
        held = self.work.taken is not None
        heightmap = self.work.heightmap if held else None
        notes = () if heightmap is None else heightmap.notes
        advice = measuring_advice(self._situation(), held=held, refused=self._refused, notes=notes)
        self.banner.advise(advice.text, (advice.act, advice.button), role=advice.role)
        live, best = self._loaded if advice.usable else (None, None)
        if live is not self.link.live:
            self.link.use(live, best)

    def _on_act(self, name: str) -> None:
        match name:
            case "virtual":
                self.context.source.choose_virtual_sensor()
            case "calibrate":
                self.calibrate_wanted.emit()
            case "sensors":
                self.context.requests.page.emit("sensors")
            case "live":
                self.release()
            case "fitting":
                self.calibrations.use_what_fits(self.link.serial, self._size)
            case "reopen":
                self.link.open()
