"""Pressing the protocol: the live picture with the mark, and captures that happen by themselves."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.calibrate.camera_link import CameraLink
from app.calibrate.watching import Watching
from app.live.live_view import LiveView
from app.live.overlay import Overlay
from app.measure.protocol_bench import BenchHand
from app.measure.protocol_look import TOLERANCE_MM, PressLooker, Target, make_target
from app.measure.protocol_panel import RunPanel
from app.measure.protocol_work import ProtocolWork
from app.shell.context import AppContext
from app.sources.processor import Failure
from app.widgets.naming import named
from gelpolight_core.measurement.steadiness import judge_press
from gelpolight_core.translation import tr

FRAMES = 4
HAND_MS = 100
"""How often the virtual bench looks what it should do."""


class PressingView(QWidget):
    """Leads through the presses of one run.

    Signals
    -------
    left()
        The person leaves the run.
    result_wanted()
        The person wants to see the result.
    """

    left = Signal()
    result_wanted = Signal()

    def __init__(self, work: ProtocolWork, *, context: AppContext) -> None:
        super().__init__()
        named(self, "protocol.pressing", tr("Press the protocol"))
        self._work, self._context = work, context
        self._bare: NDArray[Any] | None = None
        self._target: Target | None = None
        self._looker: PressLooker | None = None
        self._hand: BenchHand | None = None
        self._must_move = False
        self._watching = Watching(self)
        self.camera = CameraLink(self._watching, context=context, parent=self)
        self.live = LiveView()
        self.panel = RunPanel()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.live, 1)
        row.addWidget(self.panel)
        self._tick = QTimer(self)
        self._tick.setInterval(HAND_MS)
        self._tick.timeout.connect(self._move_hand)
        self._connect()
        self.camera.use(True)
        self._follow_source()
        self._show_next()

    def _connect(self) -> None:
        panel, work = self.panel, self._work
        panel.bare_wanted.connect(self.take_bare)
        panel.capture_wanted.connect(self.capture)
        panel.take_back_wanted.connect(self._take_back)
        panel.bench_wanted.connect(self._on_bench)
        panel.evaluate_wanted.connect(self.result_wanted)
        panel.leave_wanted.connect(self.left)
        self._watching.detected.connect(self._on_detected)
        self._watching.refused.connect(self.panel.show_live)
        self.camera.switched.connect(self._on_switched)
        self.camera.lost.connect(self._on_lost)
        self._context.source.changed.connect(self._on_source)
        work.measured.connect(panel.show_measured)
        work.changed.connect(self._show_progress)

    # What the view around it asks

    def enter(self) -> None:
        """Look at the camera."""
        self.camera.enter(True)

    def leave(self) -> None:
        """Let the camera go; the bench rests too."""
        self._tick.stop()
        self.camera.enter(False)

    def close_run(self) -> None:
        """Stop for good."""
        self._tick.stop()
        self._context.source.changed.disconnect(self._on_source)
        self.camera.enter(False)

    # The bare membrane

    def take_bare(self) -> None:
        """Take the picture that presses are told from."""
        self._watching.capture(1, self._keep_bare)

    def _keep_bare(self, frames: list[NDArray[Any]]) -> None:
        camera, seen = self._work.calibration.camera, frames[-1].shape
        if seen[:2] != (camera.height, camera.width):
            self.panel.show_live(
                tr(
                    "The camera's picture is {u}x{v}, the calibration is for {w}x{h}: choose the "
                    "camera of this sensor in the bar above."
                ).format(u=seen[1], v=seen[0], w=camera.width, h=camera.height)
            )
            self.panel.bench.setChecked(False)
            return
        self._bare = frames[-1]
        self._aim()

    # Presses

    def capture(self) -> None:
        """Take the press as it is now; it is judged all the same."""
        if self._looker is not None:
            self._watching.capture(FRAMES, self._judge)

    def _judge(self, frames: list[NDArray[Any]]) -> None:
        target = self._target
        if target is None or self._bare is None:
            return
        judged = judge_press(
            frames,
            self._bare,
            place_px=target.centre_px,
            tolerance_px=TOLERANCE_MM * target.pixels_per_mm,
        )
        if not judged.accepted:
            # The same again would be refused again; of one that moved, holding still is enough.
            self._must_move = not judged.moved
            self._watching.forget_movement()
            self._work.refuse(target.press, judged.reason)
            self.panel.show_live(tr("Refused: {why}").format(why=judged.reason))
            return
        if self._work.accept(target.press, frames):
            self._aim()
            if self._work.run.next() is None:
                self.result_wanted.emit()

    def _take_back(self) -> None:
        self._work.take_back()
        self._aim()

    def _aim(self) -> None:
        """Ask for the next press."""
        self._must_move = False
        press = self._work.run.next()
        # Nobody looks at the pictures any more: what is left to measure is measured the sooner.
        self.camera.use(press is not None)
        self._show_next()
        if press is None or self._bare is None:
            self._target = self._looker = None
            self._watching.look_with(None)
            self.live.set_overlay(Overlay())
            return
        self._target = make_target(press, self._work.picture)
        self._looker = PressLooker(self._target, self._bare)
        self._watching.look_with(self._looker)

    def _on_detected(self, item: Any) -> None:
        if self._looker is None or self._watching.capturing:
            return
        if isinstance(item, Failure):
            self.panel.show_live(item.sentence)
            return
        seen = item.value
        if seen is None:
            return
        self.live.set_overlay(seen.detection.overlay)
        # What was seen for the press before is no word on this one.
        held = self._looker.phase == "hold" and seen.detection.ready
        if self._must_move and held and not seen.moved:
            return
        self._must_move = False
        self.panel.show_live(seen.detection.sentence, good=held)
        if held and seen.still:
            self.panel.show_live(tr("Steady: it is being taken."), good=True)
            self.capture()

    # What is shown

    def _show_next(self) -> None:
        run = self._work.run
        press = run.next()
        self.panel.show_press(press, run.protocol.repeats)
        self._show_progress()
        ready = self._bare is not None and press is not None
        self.panel.capture.setEnabled(ready)
        there = self._watching.stream is not None
        self.panel.bare.setVisible(self._bare is None and press is not None)
        self.panel.bare.setEnabled(there)
        if press is None:
            self.panel.show_live("")
        elif not there:
            self.panel.show_live(tr("No camera: choose one in the bar above."))
        elif self._bare is None:
            self.panel.show_live(
                tr("Lift everything off the sensor, then say so: presses are told from that.")
            )

    def _show_progress(self) -> None:
        self.panel.show_progress(self._work.run.progress, self._work.measured_count)

    # Camera and bench

    def _on_source(self) -> None:
        self._follow_source()
        # Another camera's bare membrane is another picture.
        self._bare = None
        self.camera.open()

    def _follow_source(self) -> None:
        source = self._context.source
        virtual = source.info is not None and source.info.kind == "virtual"
        bench = source.bench if virtual else None
        self._hand = None if bench is None else BenchHand(bench)
        self.panel.bench.setVisible(bench is not None)
        if bench is None:
            self.panel.bench.setChecked(False)

    def _on_switched(self) -> None:
        self.live.set_stream(self._watching.stream)
        if self._watching.stream is None:
            done = self._work.run.next() is None
            none = tr("No camera: choose one in the bar above.")
            self.live.say(tr("All presses are made.") if done else none)
        self._aim()
        if self.panel.bench.isChecked() and self._watching.stream is not None:
            self._tick.start()

    def _on_lost(self, why: str) -> None:
        if why:
            self.panel.show_live(why)

    def _on_bench(self, on: bool) -> None:
        if on:
            self._tick.start()
        else:
            self._tick.stop()

    def _move_hand(self) -> None:
        """Do what a technician would do now."""
        press = self._work.run.next()
        if self._hand is None or press is None or self._watching.capturing:
            if press is None:
                self._tick.stop()
            return
        if self._bare is None:
            self._hand.lift()
            self.take_bare()
        elif self._looker is not None and self._looker.phase == "lift":
            self._hand.lift()
        elif not self._must_move:
            self._hand.press(press)
        else:
            self._hand.lift()
