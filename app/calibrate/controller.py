"""The calibration behind the pages: project, camera, detection, work and undo."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QUndoStack

from app.calibrate.commands import Decide
from app.calibrate.detection import Detection
from app.calibrate.jobs import Job, Jobs
from app.calibrate.look import Looker
from app.calibrate.steps import Step
from app.calibrate.still import Still
from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.source import Frame
from app.sources.stream import Stream
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.project import CalibrationProject, StageStatus
from gelpolight_core.errors import InputError
from gelpolight_core.lights.mirror import spot_near
from gelpolight_core.optics.lens_views import LensView, look_for_board
from gelpolight_core.session.decisions import Decisions, PlacedCircle, Point
from gelpolight_core.session.session import SensorData, Session
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)
DETECTION_MS = 30


@dataclass(frozen=True, slots=True)
class Seen:
    """What the detection made of a live frame, and whether the picture is still."""

    detection: Detection
    still: bool


class CalibrationController(QObject):
    """What the pages of one calibration share; no widget of its own.

    Signals
    -------
    changed()
        Captures, decisions or results changed.
    captured(str, str)
        Stage and name of a new picture.
    detected(object)
        An Outcome or Failure of the detection on the live picture.
    progressed(str, float)
        Title of the work that runs (empty: none) and its share done.
    refused(str)
        A sentence for the person.
    """

    changed = Signal()
    captured = Signal(str, str)
    detected = Signal(object)
    progressed = Signal(str, float)
    refused = Signal(str)

    def __init__(self, project: CalibrationProject, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.project = project
        self.undo = QUndoStack(self)
        self.jobs = Jobs(self)
        self.jobs.progressed.connect(self.progressed)
        self.jobs.refused.connect(self.refused)
        self.stream: Stream | None = None
        self._capture: tuple[Step, Future[list[Frame]]] | None = None
        self._inbox: Mailbox[Frame] = Mailbox()
        self._outbox: Mailbox[Outcome[Any] | Failure] = Mailbox()
        self._processor: Processor[Any] = Processor(
            self._inbox, lambda _frame: None, self._outbox, name="detection"
        )
        self._tick = QTimer(self)
        self._tick.setInterval(DETECTION_MS)
        self._tick.timeout.connect(self._poll)
        self._running: Stage | None = None
        self._views: dict[str, LensView] = {}
        self.next_radius_mm: float | None = None

    # Camera and detection

    def set_stream(self, stream: Stream | None) -> None:
        """Look at another stream; the owner starts and stops it."""
        if self.stream is not None:
            self.stream.remove_tap(self._inbox.put)
            self._processor.stop()
            self._tick.stop()
        self.stream = stream
        if stream is not None:
            stream.add_tap(self._inbox.put)
            self._processor.start()
            self._tick.start()

    def look_with(self, detect: Looker | None) -> None:
        """Use a detection from the next frame on; None: look for nothing."""
        still = Still()

        def look(frame: Frame) -> Seen | None:
            return None if detect is None else Seen(detect(frame.rgb), still.update(frame.rgb))

        self._processor.replace(look)

    def analyse(self, look: Callable[[], Any], done: Callable[[Any], None]) -> None:
        """Look at a capture beside the other work, and hand what was found to `done`."""
        self.jobs.submit(Job(tr("Looking at the picture"), lambda _tell: look(), done))

    @property
    def detection_ms(self) -> float:
        """Typical time of a detection."""
        return self._processor.figures().median_ms

    def capture(self, step: Step) -> None:
        """Take a picture for a step's stage, averaged over its frames.

        A ball press states the radius :attr:`next_radius_mm`.
        """
        if self._capture is not None:
            return
        if self.stream is None:
            self.refused.emit(tr("There is no camera. Choose a source first."))
            return
        self._capture = step, self.stream.capture(step.frames)

    @property
    def capturing(self) -> bool:
        """Whether a capture is under way."""
        return self._capture is not None

    def _poll(self) -> None:
        item = self._outbox.take()
        if item is not None:
            self.detected.emit(item)
        if self._capture is not None and self._capture[1].done():
            (step, future), self._capture = self._capture, None
            error = future.exception()
            if error is not None:
                self.refused.emit(str(error))
                return
            frames = [frame.rgb for frame in future.result()]
            self._keep(step, frames)

    def _keep(self, step: Step, frames: list[Any]) -> None:
        stage, radius_mm = step.stage, self.next_radius_mm
        assert stage is not None

        def work(_tell: Callable[[float], None]) -> str:
            name = self.project.add_capture(stage, frames)
            if stage is Stage.BALLS and radius_mm is not None:
                self.project.set_ball_radius(name, radius_mm)
            self._look_for_boards()
            return name

        def done(name: str) -> None:
            self.captured.emit(stage.value, name)
            self.changed.emit()
            self.compute(stage)

        self.jobs.submit(Job(tr("Saving the picture"), work, done))

    # Pictures and decisions

    def import_files(self, stage: Stage, files: Sequence[Path]) -> None:
        """Copy picture files into a stage."""

        def done(names: tuple[str, ...]) -> None:
            if names:
                self.captured.emit(stage.value, names[-1])
            self.changed.emit()
            self.compute(stage)

        self.jobs.submit(
            Job(
                tr("Importing pictures"),
                lambda _tell: self.project.import_files(stage, files),
                done,
            )
        )

    def exclude(self, stage: Stage, name: str, excluded: bool) -> None:
        """Leave a picture out, or take it in again; can be undone."""
        key = f"{FOLDERS[stage]}/{name}"
        now = self.project.session.decisions
        names = now.excluded | {key} if excluded else now.excluded - {key}
        text = tr("Leave out {name}") if excluded else tr("Take in {name}")
        self._decide(text.format(name=name), replace(now, excluded=names), stage)

    def place_spot(self, led: int, place: Point | None) -> None:
        """Place an LED's mirror spot by hand; can be undone."""
        now = self.project.session.decisions
        spots = _with(now.spots_px, led, place)
        self._decide(tr("Place the mirror spot"), replace(now, spots_px=spots), Stage.LIGHTS)

    def place_spot_near(self, led: int, place: Point, path: Path) -> None:
        """Place an LED's mirror spot on the one that a person points at, or where none is."""

        def done(near: Point | None) -> None:
            self.place_spot(led, near or place)

        self.analyse(lambda: spot_near(self.project.session.picture(path), place), done)

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Place the contact in a ball's picture by hand; can be undone."""
        now = self.project.session.decisions
        balls = _with(now.balls, name, circle)
        text = tr("Place the contact in {name}").format(name=name)
        self._decide(text, replace(now, balls=balls), Stage.BALLS)

    def edit_curves(self, curves: dict[int, tuple[Point, ...]]) -> None:
        """Set the reflectance curves that a person has edited; can be undone."""
        now = self.project.session.decisions
        if dict(now.curves) != curves:
            text = tr("Edit the reflectance curve")
            self._decide(text, replace(now, curves=curves), Stage.REFLECTANCE)

    def _decide(self, text: str, after: Decisions, stage: Stage) -> None:
        def apply(decisions: Decisions) -> None:
            try:
                self.project.decide(decisions)
            except InputError as error:
                self.refused.emit(str(error))
            self.changed.emit()
            self.compute(stage)

        self.undo.push(Decide(text, self.project.session.decisions, after, apply))

    def set_ball_radius(self, name: str, radius_mm: float) -> None:
        """State the radius of the ball in one picture."""
        self._try(lambda: self.project.set_ball_radius(name, radius_mm))
        self.compute(Stage.BALLS)

    def describe(self, session: Session) -> None:
        """Take a new description of the sensor, its boards and its balls."""
        self._try(lambda: self.project.describe(session))

    def set_sensor(self, sensor: SensorData) -> None:
        """Take what is stated of the sensor."""
        self._try(lambda: self.project.set_sensor(sensor))

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except InputError as error:
            self.refused.emit(str(error))
        self.changed.emit()

    # Lens views

    def lens_views(self) -> dict[str, LensView]:
        """Return what was found in each lens view that was looked at, by its picture's name."""
        lens = self.project.results.lens
        known = {} if lens is None else {view.name: view for view in lens.views}
        return {**self._views, **known}

    def _look_for_boards(self) -> None:
        """Look at lens views before there are enough for a lens; in the working thread."""
        session, known = self.project.session, self.lens_views()
        for path in session.found(FOLDERS[Stage.LENS]):
            if path.name not in known:
                view = look_for_board(session.picture(path), session.checkerboard)
                self._views = {**self._views, path.name: view}

    # Work

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return how every stage stands."""
        return self.project.statuses()

    @property
    def running(self) -> Stage | None:
        """The stage that is being computed."""
        return self._running

    def compute(self, upto: Stage | None = None) -> None:
        """Compute what is stale, up to a stage or all of it."""

        def work(tell: Callable[[float], None]) -> None:
            self._look_for_boards()
            while stale := self.project.stale(upto=upto):
                self._running = stale[0]
                try:
                    self.project.compute(stale[0], tell)
                finally:
                    self._running = None

        if self.project.stale(upto=upto):
            self.jobs.submit(Job(tr("Computing"), work, lambda _nothing: self.changed.emit()))
            self.changed.emit()

    def finish(self, done: Callable[[CalibrationRun], None]) -> None:
        """Put the calibration together, and hand it to `done`."""
        self.jobs.submit(
            Job(tr("Putting the calibration together"), lambda _tell: self.project.finish(), done)
        )

    def close(self) -> None:
        """End all work and let the camera go."""
        self.set_stream(None)
        self.jobs.close()


def _with(mapping: Any, key: Any, value: Any) -> dict[Any, Any]:
    changed = {k: v for k, v in mapping.items() if k != key}
    if value is not None:
        changed[key] = value
    return changed
