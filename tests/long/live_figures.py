"""Run the whole live path on the virtual sensor under a display, and print how it fares.

    xvfb-run -a -s "-screen 0 1920x1200x24" python tests/long/live_figures.py --minutes 5
    ... --calibration sensor.gplcal    with the depth map of every frame, as when measuring
    ... --wizard SESSION               the wizard on a copy of a session, at the steps of --steps
    ... --wizard SESSION --rounds 20   the wizard is opened and closed so often

Without the wizard the object on the sensor is dragged about for half of the time. Printed are
the frames per second made, processed and shown; how late timers of the user interface are; how old
a frame is when it is painted; and how the memory grows.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from probes import Lateness, PaintWatch, Spent, WatchedStream, reported, resident_mb
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QGraphicsView, QHBoxLayout, QWidget
from wizard_figures import show_wizard

from app.bench.bench_panel import BenchPanel
from app.live.live_view import LiveView
from app.sources.bench import Bench
from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.source import Frame
from app.sources.stream import Stream
from app.sources.virtual import VirtualSource
from app.theme import theme

DRAG_MS = 33
ROUND_S = 8.0  # half of it the object is dragged, then it lies still
ITEMS = ("ball", "cuboid", "checkerboard", "cylinder", "nut", "mirror", "coin")


def dragger(bench: Bench, items: Sequence[str] = ITEMS) -> Callable[[], None]:
    """Return what moves the object in a circle, and now and then lays another one."""
    began = time.monotonic()
    laid = -1
    camera = bench.design.camera

    def move() -> None:
        nonlocal laid
        passed = time.monotonic() - began
        round_number, within = divmod(passed, ROUND_S)
        if int(round_number) != laid:
            laid = int(round_number)
            bench.lay(items[laid % len(items)])
        if within < 0.5 * ROUND_S:
            angle = 2.0 * math.pi * within / 4.0
            radius = 0.15 * camera.height_px
            bench.drag_to(
                0.5 * camera.width_px + radius * math.cos(angle),
                0.5 * camera.height_px + radius * math.sin(angle),
            )

    return move


def processor_for(
    calibration: Path | None, stream: Stream, outbox: Mailbox[Outcome[Any] | Failure]
) -> Processor[Any] | None:
    """Return the processor that makes depth maps, if there is a calibration."""
    if calibration is None:
        return None
    from gelpolight_core.calibration.file import read_calibration
    from gelpolight_core.reconstruction.reconstructor import Reconstructor

    reconstructor = Reconstructor(read_calibration(calibration))
    inbox: Mailbox[Frame] = Mailbox()
    stream.add_tap(inbox.put)
    return Processor(inbox, lambda frame: reconstructor.depth(frame.rgb), outbox)


class Measurement:
    """The live path in a window, and what is measured on it."""

    def __init__(self, calibration: Path | None, *, drag: bool) -> None:
        self.bench = Bench()
        self.stream = Stream(VirtualSource(self.bench))
        self._outbox: Mailbox[Outcome[Any] | Failure] = Mailbox()
        self._processor = processor_for(calibration, self.stream, self._outbox)
        self.window = QWidget()
        self._view, panel = LiveView(), BenchPanel(bench=self.bench)
        panel.setFixedWidth(300)
        layout = QHBoxLayout(self.window)
        layout.addWidget(self._view, 1)
        layout.addWidget(panel)
        self.window.resize(1600, 1000)
        seen = WatchedStream(self.stream)
        self._view.set_stream(seen)
        self._paints = PaintWatch(seen.newest)
        for image in self._view.findChildren(QGraphicsView):
            image.viewport().installEventFilter(self._paints)
        self._lateness = Lateness()
        self._memory_mb: list[float] = []
        self._minutes = QTimer()
        self._minutes.timeout.connect(self._note_memory)
        self._move = QTimer()
        self._move.timeout.connect(dragger(self.bench))
        if drag:
            self._move.start(DRAG_MS)

    def start(self) -> None:
        """Show the window and let images come."""
        self.window.show()
        self.stream.start()
        if self._processor is not None:
            self._processor.start()

    def begin(self) -> None:
        """Forget what was measured while all warmed up."""
        self._paints.ages_ms.clear()
        self._lateness.late_ms.clear()
        self._before = self.stream.figures()
        self._note_memory()
        self._minutes.start(60_000)
        self._spent = Spent()

    def _note_memory(self) -> None:
        self._memory_mb.append(resident_mb())

    def progress(self) -> None:
        """Print what was measured."""
        figures, camera = self.stream.figures(), self.bench.design.camera
        span_s = self._spent.wall_s
        made = figures.made - self._before.made
        dropped = figures.dropped - self._before.dropped
        print(f"{camera.width_px} x {camera.height_px} pixels, {span_s:.0f} s")
        print(f"received: {(made - dropped) / span_s:.1f} frames/s; dropped: {dropped} of {made}")
        print(f"shown: {len(self._paints.ages_ms) / span_s:.1f} frames/s")
        if self._processor is not None:
            done = self._processor.figures()
            print(f"processed: {done.rate_hz:.1f} frames/s, median {done.median_ms:.1f} ms")
            if isinstance(last := self._outbox.take(), Failure):
                print(f"the last frame failed: {last.sentence}")
        print(reported("lateness of the user interface", self._lateness.late_ms, "ms"))
        print(reported("age of a frame when its painting begins", self._paints.ages_ms, "ms"))
        print("memory by the minute, MB:", *(f"{mb:.0f}" for mb in self._memory_mb))
        print(self._spent.reported())

    def stop(self) -> None:
        """End all threads."""
        self._move.stop()
        self._minutes.stop()
        self._view.set_stream(None)
        began = time.monotonic()
        if self._processor is not None:
            self._processor.stop()
        self.stream.stop()
        print(f"stopped in {time.monotonic() - began:.2f} s")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    # By then every item has lain on the sensor once; a machine's first depth map compiles kernels.
    parser.add_argument("--warm-up", type=float, default=75.0, help="seconds not measured")
    parser.add_argument("--calibration", type=Path, help="make depth maps with it")
    parser.add_argument("--still", action="store_true", help="nothing is dragged")
    parser.add_argument("--wizard", type=Path, metavar="SESSION", help="open the wizard on it")
    parser.add_argument("--steps", default="lens,lights,balls", help="of the wizard")
    parser.add_argument("--rounds", type=int, default=0, help="open and close the wizard so often")
    parser.add_argument("--picture", type=Path, help="file for an image of the window at the end")
    options = parser.parse_args()

    application = QApplication([])
    theme.apply(application, "light")
    if options.wizard is not None:
        seconds = 60.0 * options.minutes
        show_wizard(options.wizard, options.steps.split(","), seconds, rounds=options.rounds)
        return
    measurement = Measurement(options.calibration, drag=not options.still)
    measurement.start()
    QTimer.singleShot(int(1e3 * options.warm_up), measurement.begin)
    QTimer.singleShot(int(1e3 * (options.warm_up + 60.0 * options.minutes)), application.quit)
    application.exec()
    measurement.progress()
    if options.picture is not None:
        measurement.window.grab().save(str(options.picture))
    measurement.stop()


if __name__ == "__main__":
    main()
