"""Run the Inspect page on the virtual sensor under a display, and print how it fares.

    xvfb-run -a -s "-screen 0 1920x1200x24" python tests/long/inspect_figures.py \
        --calibration sensor.gplcal --seconds 60
    ... --effort fast                    another effort than balanced
    ... --stage four --section           what is shown: one of STAGES of app/live/stage.py

The calibration has to be one of the virtual sensor; its image size is the camera's. An object is
dragged about. Printed are the frames per second made and shown; how often the surface was drawn for
each shown frame; how late timers of the user interface are; and how old a frame is when it is
painted.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from pathlib import Path

from probes import Lateness, Spent, reported, resident_mb
from PySide6.QtCore import QEvent, QTimer
from PySide6.QtWidgets import QApplication

from app.context.context import AppContext
from app.desktop import make_application, make_context
from app.inspect.page import InspectPage
from app.live.frame_results import Shown
from app.live.stage import Layout
from app.sources.bench import PRESSED, Bench
from app.theme import theme
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.reconstructor import Reconstructor

SIZE = 1280, 800
DRAG_MS = 33
ROUND_S = 8.0  # then another object is laid


class Measurement:
    """The page in a window, and what is measured on it."""

    def __init__(self, options: argparse.Namespace, context: AppContext) -> None:
        calibration = read_calibration(options.calibration)
        design = SensorDesign()
        scaled = design.scaled(calibration.camera.width / design.camera.width_px)
        self._bench = context.source.bench = Bench(scaled)
        context.source.choose_virtual_sensor()
        self.page = InspectPage(context=context)
        self.page.resize(*SIZE)
        self.page.views.stage.arrange(Layout(options.stage, section=options.section))
        self._lateness, self._began_s = Lateness(), time.monotonic()
        self._depth_ms: list[float] = []
        self._ages_ms: list[float] = []
        self.page.live_depth.shown.connect(self._on_shown)
        self._move = QTimer()
        self._move.timeout.connect(self._drag)
        self._move.start(DRAG_MS)
        live = Reconstructor(calibration, effort=options.effort)
        self.page.live_depth.load(live, live)
        self.page.show()
        self.page.enter()

    def _drag(self) -> None:
        """Move the object in a circle, and now and then lay another one."""
        number, within = divmod(time.monotonic() - self._began_s, ROUND_S)
        item = PRESSED[int(number) % len(PRESSED)]
        if self._bench.scene.item != item:
            self._bench.lay(item)
        camera, angle = self._bench.design.camera, 2.0 * math.pi * within / ROUND_S
        u = 0.5 * camera.width_px + 0.15 * camera.height_px * math.cos(angle)
        self._bench.drag_to(u, camera.height_px * (0.5 + 0.15 * math.sin(angle)))

    def _on_shown(self, shown: Shown) -> None:
        self._depth_ms.append(shown.depth_ms)
        # After the paint events that this frame has asked for.
        QTimer.singleShot(0, lambda: self._on_painted(shown))

    def _on_painted(self, shown: Shown) -> None:
        QApplication.sendPostedEvents(None, QEvent.Type.UpdateRequest)
        self._ages_ms.append(1e3 * (time.monotonic() - shown.frame.time_s))

    def begin(self) -> None:
        """Forget what was measured while all warmed up."""
        for values in (self._lateness.late_ms, self._depth_ms, self._ages_ms):
            values.clear()
        self._drawn = self._drawings()
        self._spent, self._memory_mb = Spent(), resident_mb()

    def _drawings(self) -> int:
        view = self.page.views.surface.view
        return 0 if view is None else view.drawings

    def end(self) -> None:
        """Print what was measured, and end everything."""
        stream = self.page.live.stream
        assert stream is not None
        made_hz, drawn = stream.figures().rate_hz, self._drawings() - self._drawn
        span_s, shown = self._spent.wall_s, len(self._ages_ms)
        print(f"made: {made_hz:.1f} frames/s; shown: {shown / span_s:.1f} frames/s")
        print(f"drawings of the surface for each shown frame: {drawn / max(shown, 1):.2f}")
        print(reported("reconstruction", self._depth_ms, "ms"))
        print(reported("lateness of the user interface", self._lateness.late_ms, "ms"))
        print(reported("age of a frame when it is painted", self._ages_ms, "ms", high=95))
        print(f"memory: {self._memory_mb:.0f} MB, at the end {resident_mb():.0f} MB")
        print(self._spent.reported())
        self._move.stop()
        self.page.leave()
        self.page.may_close()
        self.page.close()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--calibration", type=Path, required=True)
    parser.add_argument("--effort", default="balanced")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--warm-up", type=float, default=12.0, help="seconds not measured")
    parser.add_argument("--stage", default="four")
    parser.add_argument("--section", action="store_true")
    options = parser.parse_args()
    application = make_application()
    theme.apply(application, "light")
    with tempfile.TemporaryDirectory() as folder:
        context = make_context(
            settings_file=Path(folder) / "desktop.ini", log_folder=Path(folder) / "log"
        )
        context.workspace.folder = Path(folder) / "workspace"
        measurement = Measurement(options, context)
        QTimer.singleShot(int(1e3 * options.warm_up), measurement.begin)
        end_ms = int(1e3 * (options.warm_up + options.seconds))
        QTimer.singleShot(end_ms, application.quit)
        application.exec()
        measurement.end()


if __name__ == "__main__":
    main()
