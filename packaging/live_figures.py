"""Run the whole live path on the virtual sensor under a display, and print how it fares.

    xvfb-run -a -s "-screen 0 1920x1200x24" python packaging/live_figures.py --minutes 5
    ... --calibration sensor.gplcal    with the depth map of every frame, as when measuring

The object on the sensor is dragged about for half of the time. Printed are the frames per second
made, processed and shown; how late timers of the user interface are; how old a frame is when it is
painted; and how the memory grows.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QEvent, QObject, Qt, QTimer
from PySide6.QtWidgets import QApplication, QGraphicsView, QHBoxLayout, QWidget

from app.bench.bench_panel import BenchPanel
from app.live.live_view import LiveView
from app.shell import theme
from app.sources.bench import Bench
from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.source import Frame
from app.sources.stream import Stream, StreamFigures
from app.sources.virtual import VirtualSource

TICK_MS = 10
DRAG_MS = 33
ROUND_S = 8.0  # half of it the object is dragged, then it lies still


class WatchedBox:
    """The stream's mailbox; notes which frame the view has taken."""

    def __init__(self, box: Mailbox[Frame]) -> None:
        self._box = box
        self.fresh: Frame | None = None

    def take(self) -> Frame | None:
        """Return the newest frame."""
        frame = self._box.take()
        if frame is not None:
            self.fresh = frame
        return frame


class WatchedStream:
    """The stream as the view sees it."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self.newest = WatchedBox(stream.newest)

    def figures(self) -> StreamFigures:
        """Return the stream's figures."""
        return self._stream.figures()


class PaintWatch(QObject):
    """Notes how old each frame is when the view begins to paint it."""

    def __init__(self, box: WatchedBox) -> None:
        super().__init__()
        self._box = box
        self.ages_ms: list[float] = []

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Look at paint events, and let all pass."""
        if event.type() == QEvent.Type.Paint and self._box.fresh is not None:
            self.ages_ms.append(1e3 * (time.monotonic() - self._box.fresh.time_s))
            self._box.fresh = None
        return False


class Lateness:
    """A timer of the user interface that notes how late it is."""

    def __init__(self) -> None:
        self.late_ms: list[float] = []
        self._due_s = math.nan
        self.timer = QTimer()
        self.timer.setTimerType(Qt.TimerType.PreciseTimer)
        self.timer.setSingleShot(True)
        self.timer.timeout.connect(self._note)
        self._again()

    def _again(self) -> None:
        self._due_s = time.monotonic() + 1e-3 * TICK_MS
        self.timer.start(TICK_MS)

    def _note(self) -> None:
        self.late_ms.append(max(0.0, 1e3 * (time.monotonic() - self._due_s)))
        self._again()


def resident_mb() -> float:
    """Return the memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def dragger(bench: Bench) -> Callable[[], None]:
    """Return what moves the object in a circle, and now and then lays another one."""
    items = ("ball", "cuboid", "checkerboard", "cylinder", "nut", "mirror", "coin")
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


def told(name: str, values: list[float], unit: str) -> str:
    """Return a line with the median, the 99th percentile and the largest of some values."""
    if not values:
        return f"{name}: nothing was measured"
    middle, high = np.percentile(values, [50, 99])
    return f"{name}: p50 {middle:.1f}, p99 {high:.1f}, largest {max(values):.1f} {unit}"


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
        for picture in self._view.findChildren(QGraphicsView):
            picture.viewport().installEventFilter(self._paints)
        self._lateness = Lateness()
        self._move = QTimer()
        self._move.timeout.connect(dragger(self.bench))
        if drag:
            self._move.start(DRAG_MS)

    def start(self) -> None:
        """Show the window and let pictures come."""
        self.window.show()
        self.stream.start()
        if self._processor is not None:
            self._processor.start()

    def begin(self) -> None:
        """Forget what was measured while all warmed up."""
        self._paints.ages_ms.clear()
        self._lateness.late_ms.clear()
        self._before = self.stream.figures()
        self._memory_mb = resident_mb()
        self._spent_s, self._since_s = time.process_time(), time.monotonic()

    def tell(self) -> None:
        """Print what was measured."""
        figures, camera = self.stream.figures(), self.bench.design.camera
        span_s = time.monotonic() - self._since_s
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
        print(told("lateness of the user interface", self._lateness.late_ms, "ms"))
        print(told("age of a frame when its painting begins", self._paints.ages_ms, "ms"))
        print(f"memory: {self._memory_mb:.0f} MB, at the end {resident_mb():.0f} MB")
        print(f"processor: {(time.process_time() - self._spent_s) / span_s:.2f} cores")

    def stop(self) -> None:
        """End all threads."""
        self._move.stop()
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
    # The first depth map of a machine compiles the kernels, which can take a minute.
    parser.add_argument("--warm-up", type=float, default=10.0, help="seconds not measured")
    parser.add_argument("--calibration", type=Path, help="make depth maps with it")
    parser.add_argument("--still", action="store_true", help="nothing is dragged")
    parser.add_argument("--picture", type=Path, help="file for a picture of the window at the end")
    options = parser.parse_args()

    application = QApplication([])
    theme.apply(application, "light")
    measurement = Measurement(options.calibration, drag=not options.still)
    measurement.start()
    QTimer.singleShot(int(1e3 * options.warm_up), measurement.begin)
    QTimer.singleShot(int(1e3 * (options.warm_up + 60.0 * options.minutes)), application.quit)
    application.exec()
    measurement.tell()
    if options.picture is not None:
        measurement.window.grab().save(str(options.picture))
    measurement.stop()


if __name__ == "__main__":
    main()
