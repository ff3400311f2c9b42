"""Run the Inspect page on the virtual sensor under a display, and print how it fares.

    xvfb-run -a -s "-screen 0 1920x1200x24" python tests/long/inspect_figures.py \
        --calibration sensor.gplcal --seconds 60
    ... --model paper          another model than the calibration's
    ... --source FOLDER|FILE   images or a recording in place of the virtual sensor
    ... --views surface        the views that are shown; all others are hidden

The calibration has to be one of the virtual sensor, or of the sensor that the images are of; its
image size is the camera's. On the virtual sensor an object is dragged about for half of the
time. Printed are the frames per second made, processed and shown; how often the surface was drawn
for each shown frame; how late timers of the user interface are; how old a frame is when it is
painted; and what was computed for views that are hidden.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from probes import Lateness, Spent, ThreadTimes, reported, resident_mb
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication

from app.context.context import AppContext
from app.desktop import make_application, make_context
from app.inspect.page import InspectPage
from app.live.frame_results import Shown
from app.sources.bench import PRESSED, Bench
from app.sources.listing import image_folder, recording, virtual_sensor
from app.theme import theme
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.reconstructor import Reconstructor

SIZE = 1280, 800
DRAG_MS = 33
ROUND_S = 8.0  # half of it the object is dragged, then it lies still


def dragger(bench: Bench) -> Callable[[], None]:
    """Return what moves the object in a circle, and now and then lays another one."""
    began, camera = time.monotonic(), bench.design.camera
    laid = -1

    def move() -> None:
        nonlocal laid
        round_number, within = divmod(time.monotonic() - began, ROUND_S)
        if int(round_number) != laid:
            laid = int(round_number)
            bench.lay(PRESSED[laid % len(PRESSED)])
        if within < 0.5 * ROUND_S:
            angle = 2.0 * math.pi * within / 4.0
            radius = 0.15 * camera.height_px
            bench.drag_to(
                0.5 * camera.width_px + radius * math.cos(angle),
                0.5 * camera.height_px + radius * math.sin(angle),
            )

    return move


class Watch(QObject):
    """Notes how old each frame is when the views have painted it, and what was made of it."""

    def __init__(self, page: InspectPage) -> None:
        super().__init__()
        self.page = page
        self.ages_ms: list[float] = []
        self.total_ms: list[float] = []
        self.depth_ms: list[float] = []
        self.needless = 0
        self._fresh: Shown | None = None

        def noted(shown: Shown) -> None:
            self._fresh = shown
            self._look(shown)
            # After the paint events that this frame has asked for.
            QTimer.singleShot(0, lambda: self._painted(shown))

        page.depth.shown.connect(noted)

    def _look(self, shown: Shown) -> None:
        views, made = self.page.views._visible, shown
        pairs = (
            (views["surface"], made.surface),
            (views["height"], made.height),
            (views["normals"], made.normals),
            (views["quality"], made.quality),
        )
        self.needless += sum(not visible and made is not None for visible, made in pairs)
        self.total_ms.append(shown.total_ms)
        self.depth_ms.append(shown.depth_ms)

    def _painted(self, shown: Shown) -> None:
        QApplication.sendPostedEvents(None, QEvent.Type.UpdateRequest)
        self.ages_ms.append(1e3 * (time.monotonic() - shown.frame.time_s))

    def forget(self) -> None:
        """Forget what was noted."""
        for values in (self.ages_ms, self.total_ms, self.depth_ms):
            values.clear()
        self.needless = 0


class Measurement:
    """The page in a window, and what is measured on it."""

    def __init__(self, options: argparse.Namespace, context: AppContext) -> None:
        calibration = read_calibration(options.calibration)
        self.page = InspectPage(context=context)
        self.page.resize(*SIZE)
        self._choose(options.source, calibration.camera.width, context)
        shown = options.views.split(",")
        for name, dock in self.page.views.docks.items():
            dock.setVisible(name in shown)
        self.watch = Watch(self.page)
        self._lateness = Lateness()
        self._move = QTimer()
        if context.source.bench is not None and not options.still:
            self._move.timeout.connect(dragger(context.source.bench))
            self._move.start(DRAG_MS)
        live = Reconstructor(calibration, model=options.model, effort=options.effort)
        self.page.depth.calibrations.loaded.emit(live, live)

    def _choose(self, source: Path | None, width: int, context: AppContext) -> None:
        if source is None:
            design = SensorDesign()
            context.source.bench = Bench(design.scaled(width / design.camera.width_px))
            context.source.choose(virtual_sensor(context.source.bench))
            return
        context.source.choose((image_folder if source.is_dir() else recording)(source))

    def start(self) -> None:
        """Show the page."""
        self.page.show()
        self.page.enter()

    def begin(self) -> None:
        """Forget what was measured while all warmed up."""
        self.watch.forget()
        self._lateness.late_ms.clear()
        view = self.page.views.surface.view
        self._drawings = 0 if view is None else view.drawings
        stream = self.page.live.stream
        self._before = None if stream is None else stream.figures()
        self._spent, self._threads, self._memory_mb = Spent(), ThreadTimes(), resident_mb()

    def progress(self) -> None:
        """Print what was measured."""
        stream, span_s = self.page.live.stream, self._spent.wall_s
        assert stream is not None and self._before is not None
        made = stream.figures().made - self._before.made
        shown = len(self.watch.ages_ms)
        print(f"{stream.source.size[0]} x {stream.source.size[1]} pixels, {span_s:.0f} s")
        print(f"made: {made / span_s:.1f} frames/s; shown: {shown / span_s:.1f} frames/s")
        view = self.page.views.surface.view
        if view is not None and shown:
            drawn = view.drawings - self._drawings
            print(f"drawings of the surface for each shown frame: {drawn / shown:.2f}")
        print(f"made for hidden views: {self.watch.needless}")
        print(reported("reconstruction", self.watch.depth_ms, "ms"))
        print(reported("all processing of a frame", self.watch.total_ms, "ms"))
        print(reported("lateness of the user interface", self._lateness.late_ms, "ms"))
        print(reported("age of a frame when it is painted", self.watch.ages_ms, "ms", high=95))
        print(f"memory: {self._memory_mb:.0f} MB, at the end {resident_mb():.0f} MB")
        print(self._spent.reported())
        print("processor time for each shown frame, by thread:")
        print(self._threads.reported(shown))

    def stop(self) -> None:
        """End everything."""
        self._move.stop()
        self.page.leave()
        self.page.may_close()
        self.page.close()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--calibration", type=Path, required=True)
    parser.add_argument("--model", choices=("paper", "full"))
    parser.add_argument("--effort", default="balanced")
    parser.add_argument("--source", type=Path, help="folder of images, or recording")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--warm-up", type=float, default=12.0, help="seconds not measured")
    parser.add_argument("--views", default="surface,height,camera,look,bench")
    parser.add_argument("--still", action="store_true", help="nothing is dragged")
    options = parser.parse_args()
    application: Any = make_application()
    theme.apply(application, "light")
    with tempfile.TemporaryDirectory() as folder:
        context = make_context(
            settings_file=Path(folder) / "desktop.ini", log_folder=Path(folder) / "log"
        )
        context.workspace.folder = Path(folder) / "workspace"
        # As a person would have chosen it.
        context.settings.prefer(reconstruction=f"{options.model or 'full'}/{options.effort}")
        measurement = Measurement(options, context)
        measurement.start()
        QTimer.singleShot(int(1e3 * options.warm_up), measurement.begin)
        QTimer.singleShot(int(1e3 * (options.warm_up + options.seconds)), application.quit)
        application.exec()
        measurement.progress()
        measurement.stop()


if __name__ == "__main__":
    main()
