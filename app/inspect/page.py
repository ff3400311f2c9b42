"""The Inspect page: depth live, in 3D and as maps, with one cursor in all of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.inspect.actions import Deeds
from app.inspect.advice import Situation, advise
from app.inspect.banner import Banner
from app.inspect.calibration_choice import CalibrationBox, CalibrationChoice
from app.inspect.drift_watch import DriftWatch
from app.inspect.first_calibration import begin_first_calibration
from app.inspect.link import LiveLink
from app.inspect.place import PixelPlaces, read_at
from app.inspect.products import Shown
from app.inspect.record_control import RecordControl
from app.inspect.replay_bar import ReplayBar
from app.inspect.situation import situation_of
from app.inspect.views import Views
from app.inspect.ways import WayChoice
from app.shell.actions import make_action
from app.shell.context import AppContext
from app.shell.jobs import Jobs
from app.sources.listing import picture_folders
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.recording import ENDING
from gelpolight_core.translation import tr

WORDS_MS = 250


class InspectPage(QWidget):
    """Shows what is pressed into the sensor.

    Parameters
    ----------
    context : AppContext
        The program's.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "inspect", tr("Inspect"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.context = context
        self.jobs = Jobs("inspect", self)
        self.views = Views(self.jobs, context=context)
        self.link = LiveLink(self._show, context=context, parent=self)
        self.box = CalibrationBox()
        self.calibrations = CalibrationChoice(self.jobs, self.box, context=context)
        self.ways = WayChoice(self.jobs, self, context=context)
        self.banner = Banner(
            tr("Press an object into the membrane. Space lets the picture stand with all detail.")
        )
        self._readout = named(PlainLabel(), "inspect.readout", tr("What is under the cursor"))
        self._rate = named(PlainLabel(), "inspect.rate", tr("How fast it is shown"))
        self._cursor = (math.nan, math.nan)
        self._places: PixelPlaces | None = None
        self._shown: Shown | None = None
        self._trouble = self._recorded = self._drift = ""
        self.drift = DriftWatch(self.jobs, self)
        self._size: tuple[int, int] | None = None
        self._loaded: tuple[Reconstructor | None, Reconstructor | None] = None, None
        self._lay_out()
        self._connect()
        self.views.restore()

    def _lay_out(self) -> None:
        foot = QWidget()
        row = QHBoxLayout(foot)
        row.setContentsMargins(8, 2, 8, 2)
        row.addWidget(self._readout, 1)
        row.addWidget(self._rate)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        self.pause_action = make_action(
            self, "inspect.pause", tr("Pause"), lambda: self.pause(not self.link.paused),
            keys=("Space",), icon_name="pause", tip=tr("Let the picture stand, with all detail"),
        )  # fmt: skip
        self.pause_action.setCheckable(True)
        # Other pages have a use of their own for the bar.
        self.pause_action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        self.recorder = RecordControl(self.link, self, context=self.context)
        self.deeds = Deeds(self.link, self.views, self.jobs, self, context=self.context)
        deeds = self.deeds
        self.views.bar.insertActions(
            self.views.bar.actions()[0],
            [
                self.pause_action,
                self.recorder.action,
                deeds.zero_action,
                deeds.export_action,
                deeds.picture_action,
            ],
        )
        self.views.add_to_bar(self.box)
        self.views.add_to_bar(self.ways.box)
        self.replay = ReplayBar()
        column.addWidget(self.banner)
        column.addWidget(self.views, 1)
        column.addWidget(self.replay)
        column.addWidget(foot)

    def _connect(self) -> None:
        self.views.wanted_changed.connect(self._want)
        self.views.pointed.connect(self._on_pointed)
        self.views.picture_pointed.connect(self._on_picture_pointed)
        self.calibrations.loaded.connect(self._on_loaded)
        self.ways.chosen.connect(self._use)
        self.drift.said.connect(self._on_drift)
        self.context.source.changed.connect(self._on_source)
        self.link.said.connect(self._on_said)
        self.link.switched.connect(self._on_switched)
        self.recorder.told.connect(self._on_recorded)
        self.jobs.progressed.connect(self.banner.show_work)
        # Where work has ended, it may have come to nothing.
        self.jobs.progressed.connect(lambda title, _share: title or self._advise())
        self.jobs.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        self.banner.stop_wanted.connect(self.jobs.cancel)
        self.banner.act_wanted.connect(self._on_act)
        self._words = QTimer(self)
        self._words.setInterval(WORDS_MS)
        self._words.timeout.connect(self._tell)

    # What the window asks of a page

    def enter(self) -> None:
        """Look at the source, through the calibration in use."""
        self.calibrations.refresh()
        self.calibrations.refer_cameras(self._loaded[0])
        self._want()
        self._look_for_drift()
        self.link.enter(True)
        self._words.start()
        self._advise()
        self.setFocus()

    def leave(self) -> None:
        """Let the source go."""
        self._words.stop()
        self.recorder.stop()
        self.link.enter(False)
        self.views.keep()

    def may_close(self) -> bool:
        """Nothing is lost by closing."""
        self.recorder.close()
        self.link.enter(False)
        self.views.keep()
        self.jobs.close()
        # The reconstructors' threads end with the last reference to them.
        self._loaded = None, None
        self.ways.close()
        self.link.use(None)
        self.views.finish()
        return True

    def open_path(self, path: Path) -> None:
        """Take a folder of pictures, or a recording, as the camera."""
        if path.suffix == ENDING:
            self.context.source.choose_recording(path)
            return
        for info in picture_folders([path])():
            self.context.source.choose(info)

    def begin_demo(self) -> None:
        """Look at the virtual sensor."""
        self.context.source.choose_virtual_sensor()

    # The picture

    def pause(self, on: bool) -> None:
        """Let the picture stand, or go on."""
        self.pause_action.setChecked(on)
        self.link.pause(on)
        self._want()

    def _want(self) -> None:
        self.link.want(replace(self.views.wanted(), still=self.link.paused))

    def _show(self, shown: Shown) -> None:
        self._shown = shown
        size = shown.frame.rgb.shape[1], shown.frame.rgb.shape[0]
        if size != self._size:
            self._size = size
            self._advise()
        self.drift.look(shown, self.link.reconstructor)
        self.views.show_frame(shown, still=self.link.paused)

    def _look_for_drift(self) -> None:
        """Forget what was said of the background, and look at it again."""
        self._drift = ""
        self.drift.again()

    def _on_drift(self, sentence: str) -> None:
        self._drift = sentence
        self._advise()

    def _on_loaded(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Look through another calibration, where it belongs to the pictures."""
        self._loaded = None, None
        self._look_for_drift()
        self.link.use(None)
        self._places = None
        self._forget()
        self.ways.take(live, best)

    def _use(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Look through the calibration in the way that is chosen."""
        self._loaded = live, best
        if self.isVisible():
            self.calibrations.refer_cameras(live)
        self._advise()

    # The cursor

    def _on_pointed(self, x_mm: float, y_mm: float) -> None:
        self._cursor = (x_mm, y_mm)
        self.views.show_cursor(x_mm, y_mm)
        pixel = None
        if self._places is not None and math.isfinite(x_mm):
            pixel = self._places.pixel_of(x_mm, y_mm, self._depth())
        self.views.show_pixel(pixel)
        self._tell()

    def _on_picture_pointed(self, u: float, v: float) -> None:
        place = None if self._places is None else self._places.place_of(u, v, self._depth())
        self._cursor = place or (math.nan, math.nan)
        self.views.show_cursor(*self._cursor)
        self._tell()

    def _depth(self) -> NDArray[np.float32] | None:
        heightmap = None if self._shown is None else self._shown.heightmap
        return None if heightmap is None else heightmap.depth_mm

    def _tell(self) -> None:
        self.ways.follow(self.link.last)
        self._rate.setText("    ".join(filter(None, (self._recorded, self.link.words()))))
        self._rate.setToolTip(plain_tip(self.link.plan_words()))
        heightmap = None if self._shown is None else self._shown.heightmap
        text = tr("Point at a view to read the depth there.")
        if heightmap is None:
            text = ""
        elif math.isfinite(self._cursor[0]):
            reading = read_at(heightmap, *self._cursor)
            text = text if reading is None else reading.text()
        self._readout.setText(text)

    # What to do next

    def _on_source(self) -> None:
        self.recorder.stop()
        self._size = None
        self._look_for_drift()
        self._forget()
        self.link.open()
        self._advise()

    def _on_switched(self) -> None:
        # What stood was of the stream that has gone: nothing could be made anew of it.
        self.pause(False)
        self.views.follow_source()
        self.replay.follow(None if self.link.stream is None else self.link.stream.source)

    def _on_recorded(self, words: str) -> None:
        self._recorded = words
        self._tell()

    def _on_said(self, sentence: str) -> None:
        # A camera that was plugged in again may have moved.
        if self._trouble and not sentence:
            self._look_for_drift()
        self._trouble = sentence
        self._advise()

    def _situation(self) -> Situation:
        return situation_of(
            self.link, self.calibrations, self._loaded[0], context=self.context,
            size=self._size, trouble=self._trouble, drift=self._drift,
        )  # fmt: skip

    def _advise(self) -> None:
        """Say what to do next, and look through the calibration only where it fits."""
        advice = advise(self._situation())
        self.banner.advise(advice.text, (advice.act, advice.button), role=advice.role)
        live, best = self._loaded if advice.usable else (None, None)
        before = self.link.live
        if live is before:
            return
        self.link.use(live, best)
        if live is not None and before is not None and live.calibration is before.calibration:
            return
        self._places = None if live is None else PixelPlaces(live.calibration.table)
        if live is not None:
            self.views.prepare()
        self._forget()

    def _forget(self) -> None:
        """Show and read no depth: what was seen is of another calibration or source."""
        self._shown = None
        self.views.forget()

    def _on_act(self, name: str) -> None:
        match name:
            case "virtual":
                self.context.source.choose_virtual_sensor()
            case "calibrate":
                self.calibrate_now()
            case "sensors":
                self.context.requests.page.emit("sensors")
            case "fitting":
                self.calibrations.use_what_fits(self.link.serial, self._size)
            case "reopen":
                self.link.open()
            case "zero":
                self.deeds.zero()

    def calibrate_now(self) -> None:
        """Calibrate the virtual sensor, so that there is something to see."""
        begin_first_calibration(self.jobs, context=self.context)
