"""Makes the presses of the protocol: live image with the mark, and automatic capture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.context.context import AppContext
from app.live.live_detection import LiveDetection
from app.live.live_view import LiveView
from app.live.overlay import Overlay
from app.live.session import LiveSession
from app.measure.press_check import TOLERANCE_MM, PressCheck, Target, make_target, why_not_bare
from app.measure.protocol_panel import RunPanel
from app.measure.protocol_work import ProtocolWork
from app.sources.bench import Bench
from app.sources.latest import Done
from app.widgets.buttons import Slot
from app.widgets.layout import hbox
from app.widgets.naming import named
from app.widgets.timers import timer
from gelpolight_core.measurement.characteristics import LEAST_FLAT
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.steadiness import judge_press

FRAMES = 4
HAND_MS = 100
"""Interval at which the virtual bench checks for its next action."""

HAND_MM, HAND_DEG = 0.1, 1.0
"""Repeatability of placing by hand, one standard deviation."""


class BenchHand:
    """Places on the bench what the protocol requests.

    Parameters
    ----------
    bench : Bench
        Of the virtual sensor.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._laid: Press | None = None

    def lift(self) -> None:
        """Remove everything from the sensor."""
        self._laid = None
        if self._bench.scene.item != "bare":
            self._bench.lay("bare")

    def press(self, wanted: Press) -> None:
        """Press an object in, once."""
        if wanted == self._laid:
            return
        self._laid = wanted
        rng = np.random.default_rng([self._bench.seed, *wanted.file.encode()])
        dx_mm, dy_mm, turn_deg = rng.standard_normal(3) * (HAND_MM, HAND_MM, HAND_DEG)
        x_mm, y_mm = wanted.position_mm
        self._bench.lay(wanted.truth.shape)
        self._bench.arrange(
            size_mm=wanted.truth.size_mm,
            depth_mm=wanted.truth.height_mm,
            x_mm=x_mm + dx_mm,
            y_mm=y_mm + dy_mm,
            yaw_deg=wanted.yaw_deg + turn_deg,
        )


class PressingView(QWidget):
    """Guides the user through the presses of one run.

    Parameters
    ----------
    work : ProtocolWork
        The run.
    context : AppContext
        Shared by all pages.
    on_leave, on_result : callable
        Leave the run, and show its result.
    """

    def __init__(
        self, work: ProtocolWork, *, context: AppContext, on_leave: Slot, on_result: Slot
    ) -> None:
        super().__init__()
        named(self, "protocol.pressing", "Make the presses")
        self._work, self._context, self._on_result = work, context, on_result
        self._bare: NDArray[Any] | None = None
        self._target: Target | None = None
        self._check: PressCheck | None = None
        self._hand: BenchHand | None = None
        self._must_move = False
        self.live = LiveSession(context=context, name="protocol", parent=self)
        self._detection = LiveDetection(self.live)
        self.image = LiveView()
        own = {"bare": self.take_bare, "capture": self.capture, "take_back": self._take_back}
        self.panel = RunPanel({**own, "leave": on_leave, "evaluate": on_result})
        hbox((self.image, 1), self.panel, of=self, margins=0, spacing=0)
        self._tick = timer(self, HAND_MS, self._move_hand)
        self.panel.bench.toggled.connect(lambda on: self._tick.start() if on else self._tick.stop())
        self.live.processed.connect(self._on_detected)
        self.live.switched.connect(self._on_switched)
        self.live.lost.connect(self._on_lost)
        self.live.source_changed.connect(self._on_source)
        work.changed.connect(self._show_progress)
        self._follow_source()
        self._show_next()

    # Called by the parent view

    def enter(self) -> None:
        """Start using the camera."""
        self.live.enter(True)

    def leave(self) -> None:
        """Release the camera, and stop the bench."""
        self._tick.stop()
        self.live.enter(False)

    def close_run(self) -> None:
        """Stop for good."""
        self._tick.stop()
        self.live.finish()

    # The bare membrane

    def take_bare(self) -> None:
        """Capture the image of the bare membrane as the reference for all presses."""
        self.live.capture(LEAST_FLAT, self._keep_bare, self.panel.show_live)

    def _keep_bare(self, frames: list[NDArray[Any]]) -> None:
        camera, seen = self._work.calibration.camera, frames[-1].shape
        if seen[:2] != (camera.height, camera.width):
            text = (
                "The camera image is {u}x{v} pixels, but the calibration is for {w}x{h}. Choose "
                "the camera of this sensor in the bar above."
            )
            sizes = {"u": seen[1], "v": seen[0], "w": camera.width, "h": camera.height}
            self.panel.show_live(text.format(**sizes))
            self.panel.bench.setChecked(False)
            return
        problem = why_not_bare(frames[-1], self._work.calibration)
        if problem:
            self._show_next()
            # The line beside the image already asks for the same, and changes with every frame.
            self._context.toasts.show(f"Refused: {problem}", "fail")
            return
        self._bare = frames[-1]
        self._work.keep_flat(frames)
        self._aim()

    # Presses

    def capture(self) -> None:
        """Capture the press as it is. It is still checked."""
        if self._check is not None:
            self.live.capture(FRAMES, self._judge, self.panel.show_live)

    def _judge(self, frames: list[NDArray[Any]]) -> None:
        target = self._target
        if target is None or self._bare is None:
            return
        fault = judge_press(
            frames,
            self._bare,
            position_px=target.centre_px,
            tolerance_px=TOLERANCE_MM * target.pixels_per_mm,
        )
        if fault is not None:
            # An identical press would be refused again. If it moved, holding still is enough.
            self._must_move = fault.key != "moved"
            self._detection.forget_movement()
            self._work.refuse(target.press, fault.line)
            self.panel.show_live(f"Refused: {fault.line}")
            return
        if self._work.accept(target.press, frames):
            self._aim()
            if self._work.run.next() is None:
                self._on_result()

    def _take_back(self) -> None:
        self._work.take_back()
        self._aim()

    def _aim(self) -> None:
        """Request the next press."""
        self._must_move = False
        press = self._work.run.next()
        # The images are no longer needed, so the remaining measurements get more time.
        self.live.use(press is not None)
        self._show_next()
        if press is None or self._bare is None:
            self._target = self._check = None
            self._detection.set_detector(None)
            self.image.set_overlay(Overlay())
            return
        self._target = make_target(press, self._work.calibration)
        self._check = PressCheck(self._target, self._bare)
        self._detection.set_detector(self._check)

    def _on_detected(self, item: Done[Any, Any]) -> None:
        if self._check is None or self.live.capturing:
            return
        if item.failure:
            self.panel.show_live(item.failure)
            return
        seen = item.result
        if seen is None:
            return
        self.image.set_overlay(seen.detection.overlay)
        # Observations of the previous press do not apply to this one.
        at_mark = self._check.phase == "hold" and seen.detection.good
        if self._must_move and at_mark and not seen.moved:
            return
        self._must_move = False
        self.panel.show_live(seen.detection.sentence, good=at_mark)
        if at_mark and seen.still:
            self.panel.show_live("Steady. Capturing…", good=True)
            self.capture()

    # What is shown

    def _show_next(self) -> None:
        run = self._work.run
        press = run.next()
        self.panel.show_press(press, run.protocol.repeats)
        self._show_progress()
        ready = self._bare is not None and press is not None
        self.panel.capture.setEnabled(ready)
        there = self.live.stream is not None
        # It remains visible: with a wrong first image, every press would be refused.
        self.panel.bare.setVisible(press is not None)
        self.panel.bare.setEnabled(there)
        first, again = "Capture &bare membrane", "Capture &bare membrane again"
        self.panel.bare.setText(first if self._bare is None else again)
        if press is None:
            self.panel.show_live("")
        elif not there:
            self.panel.show_live("No camera is selected. Choose one in the bar above.")
        elif self._bare is None:
            text = 'Lift everything off the sensor, then click "Capture bare membrane".'
            self.panel.show_live(text)

    def _show_progress(self) -> None:
        self.panel.show_progress(self._work.run.progress, self._work.outcomes)

    # Camera and bench

    def _on_source(self) -> None:
        self._follow_source()
        # Another camera needs its own image of the bare membrane.
        self._bare = None

    def _follow_source(self) -> None:
        bench = self._context.source.virtual
        self._hand = None if bench is None else BenchHand(bench)
        self.panel.bench.setVisible(bench is not None)
        if bench is None:
            self.panel.bench.setChecked(False)

    def _on_switched(self) -> None:
        self.image.set_stream(self.live.stream)
        if self.live.stream is None:
            done = self._work.run.next() is None
            none = "No camera is selected. Choose one in the bar above."
            self.image.image.say("All presses are done." if done else none)
        self._aim()
        if self.panel.bench.isChecked() and self.live.stream is not None:
            self._tick.start()

    def _on_lost(self, why: str) -> None:
        if why:
            self.panel.show_live(why)

    def _move_hand(self) -> None:
        """Let the virtual bench do the next action of a technician."""
        press = self._work.run.next()
        if self._hand is None or press is None or self.live.capturing:
            if press is None:
                self._tick.stop()
            return
        if self._bare is None:
            self._hand.lift()
            self.take_bare()
        elif self._must_move or (self._check is not None and self._check.phase == "lift"):
            self._hand.lift()
        else:
            self._hand.press(press)
